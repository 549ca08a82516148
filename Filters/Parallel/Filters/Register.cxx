// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// From when this library is loaded, filters and writers with a controller work together with its processes.
#include "Data/Processes.h"
#include "ProcessExchange.h"
#include "ProcessParts.h"

namespace bigus
{
namespace
{

[[maybe_unused]] const bool kIsRegistered = []
{
  RegisterExchange([](vtkMultiProcessController* controller) -> std::unique_ptr<Exchange>
                   { return std::make_unique<ProcessExchange>(controller); });
  FieldParts::Register([](vtkMultiProcessController* controller) -> std::unique_ptr<FieldParts>
                       { return std::make_unique<ProcessParts>(controller); });
  return true;
}();

}  // namespace
}  // namespace bigus
