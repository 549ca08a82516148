// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What the filters share of VTK's pipeline: requests, properties that may be left to a default, and tables.
#ifndef BigusPipelineSupport_h
#define BigusPipelineSupport_h

#include <algorithm>
#include <cstddef>
#include <functional>

#include "vtkBigusFiltersModule.h"  // for the ABI namespace
#include "vtkNew.h"
#include "vtkTable.h"

#ifdef VTK_ABI_NAMESPACE_BEGIN  // from VTK 9.2 on
VTK_ABI_NAMESPACE_BEGIN
#endif
class vtkAlgorithm;
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

/// Makes what a filter has to give empty; it is made anew at the next update.
void ClearOutputs(vtkInformationVector* outputs);

/// Does the work of a filter's RequestData. Its outputs are empty before, and after the work has thrown: then what was thrown
/// becomes the filter's error. Returns 1, or 0 after an error.
int Execute(vtkAlgorithm* filter, vtkInformationVector* outputs, const std::function<void()>& work);

/// A new column of a table with a value of every row: a member, or what a function gives of a row.
template <class Array, class Rows, class Value>
void AddColumn(vtkTable* table, const char* name, const Rows& rows, const Value& value)
{
  vtkNew<Array> column;
  column->SetName(name);
  column->SetNumberOfValues(static_cast<vtkIdType>(rows.size()));
  for (std::size_t k = 0; k < rows.size(); ++k)
  {
    column->SetValue(static_cast<vtkIdType>(k), std::invoke(value, rows[k]));
  }
  table->AddColumn(column);
}

}  // namespace bigus

// Set<name> and Set<name>ToDefault of a property of so many numbers, which is derived while Compute<name> is true, and shows
// `value` until then.
#define vtkBigusDerivedPropertyMacro(Class, name, type, count, value)             \
  void Class::Set##name(const type values[count])                                 \
  {                                                                               \
    if (this->Compute##name || !std::equal(values, values + (count), this->name)) \
    {                                                                             \
      std::copy_n(values, count, this->name);                                     \
      this->Compute##name = false;                                                \
      this->Modified();                                                           \
    }                                                                             \
  }                                                                               \
  void Class::Set##name##ToDefault()                                              \
  {                                                                               \
    if (!this->Compute##name)                                                     \
    {                                                                             \
      std::fill_n(this->name, count, value);                                      \
      this->Compute##name = true;                                                 \
      this->Modified();                                                           \
    }                                                                             \
  }

#endif
