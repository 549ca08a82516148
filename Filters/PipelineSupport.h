// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What the filters share of VTK's pipeline: requests, properties that may be left to a default, and tables.
#ifndef BigusPipelineSupport_h
#define BigusPipelineSupport_h

#include <algorithm>
#include <cstddef>

#include "vtkBigusFiltersModule.h"  // for the ABI namespace
#include "vtkNew.h"
#include "vtkTable.h"

#ifdef VTK_ABI_NAMESPACE_BEGIN  // from VTK 9.2 on
VTK_ABI_NAMESPACE_BEGIN
#endif
class vtkInformationVector;
#ifdef VTK_ABI_NAMESPACE_END
VTK_ABI_NAMESPACE_END
#endif

namespace bigus
{

/// Asks the connections of an input port for all of their data, whole images and undivided fields.
void RequestWholeInput(vtkInformationVector* connections);

/// Withdraws what was asked of a filter that failed: VTK keeps it otherwise, and adds it to every later request.
void ForgetRequests(vtkInformationVector* outputs);

/// Sets a property that is derived while `derived` is true. True when that changed something.
template <class T, std::size_t N>
bool GiveValues(const T* values, T (&property)[N], bool& derived)
{
  if (!derived && std::equal(values, values + N, property))
  {
    return false;
  }
  std::copy_n(values, N, property);
  derived = false;
  return true;
}

/// Makes the property derived again; it shows `value` until then. True when that changed something.
template <class T, std::size_t N>
bool TakeValuesBack(T value, T (&property)[N], bool& derived)
{
  if (derived)
  {
    return false;
  }
  std::fill_n(property, N, value);
  derived = true;
  return true;
}

/// A new column of a table, whose values are to be set.
template <class Array>
Array* AddColumn(vtkTable* table, const char* name, std::size_t rows)
{
  vtkNew<Array> column;
  column->SetName(name);
  column->SetNumberOfValues(static_cast<vtkIdType>(rows));
  table->AddColumn(column);
  return column;
}

}  // namespace bigus

#endif
