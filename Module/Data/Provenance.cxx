// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Data/Provenance.h"

#include <string>

#include "Core/Trainer/Provenance.h"
#include "vtkDataObject.h"
#include "vtkFieldData.h"
#include "vtkNew.h"
#include "vtkStringArray.h"

namespace bigus
{
namespace
{

bool HasKey(const std::string& line, const std::string& key)
{
  return line.compare(0, key.size(), key) == 0 && line.size() > key.size() && line[key.size()] == '=';
}

}  // namespace

std::vector<std::string> ProvenanceOf(vtkDataObject* data)
{
  auto* array = vtkStringArray::SafeDownCast(data->GetFieldData()->GetAbstractArray("Provenance"));
  std::vector<std::string> lines;
  for (vtkIdType i = 0; array && i < array->GetNumberOfValues(); ++i)
  {
    lines.push_back(array->GetValue(i));
  }
  return lines;
}

void ReplaceProvenance(vtkDataObject* data, const std::vector<std::string>& lines)
{
  if (lines.empty())
  {
    data->GetFieldData()->RemoveArray("Provenance");
    return;
  }
  vtkNew<vtkStringArray> array;  // a new one, because another data object may share the old one
  array->SetName("Provenance");
  for (const std::string& line : lines)
  {
    array->InsertNextValue(line);
  }
  data->GetFieldData()->AddArray(array);
}

void SetProvenance(vtkDataObject* data, const std::string& key, const std::string& value)
{
  std::vector<std::string> lines = ProvenanceOf(data);
  SetProvenanceLine(lines, key, value);
  ReplaceProvenance(data, lines);
}

std::string GetProvenance(vtkDataObject* data, const std::string& key)
{
  for (const std::string& line : ProvenanceOf(data))
  {
    if (HasKey(line, key))
    {
      return line.substr(key.size() + 1);
    }
  }
  return "";
}

}  // namespace bigus
