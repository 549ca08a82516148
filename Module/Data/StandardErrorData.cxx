// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Data/StandardErrorData.h"

#include <cstring>

#include "Core/Model/Error.h"
#include "Data/Arrays.h"
#include "vtkDataObject.h"
#include "vtkUnsignedCharArray.h"

namespace bigus
{
namespace
{

constexpr const char* kStandardError = "StandardError";

}  // namespace

std::string StandardErrorOf(vtkDataObject* data)
{
  vtkAbstractArray* const found = data->GetFieldData()->GetAbstractArray(kStandardError);
  auto* const bytes = vtkUnsignedCharArray::SafeDownCast(found);
  if (found && (!bytes || bytes->GetNumberOfComponents() != 1))
  {
    throw Error("Gaussian field: the array StandardError is of " + std::to_string(found->GetNumberOfComponents()) +
                " components of " + found->GetDataTypeAsString() + "; it holds unsigned char of 1. Remove it.");
  }
  return bytes ? std::string(reinterpret_cast<const char*>(bytes->GetPointer(0)),
                             static_cast<std::size_t>(bytes->GetNumberOfValues()))
               : std::string();
}

void ReplaceStandardError(vtkDataObject* data, const std::string& bytes)
{
  data->GetFieldData()->RemoveArray(kStandardError);
  if (!bytes.empty())
  {
    const auto array = NewArray<vtkUnsignedCharArray>(kStandardError, 1, static_cast<vtkIdType>(bytes.size()));
    std::memcpy(array->GetPointer(0), bytes.data(), bytes.size());
    data->GetFieldData()->AddArray(array);
  }
}

}  // namespace bigus
