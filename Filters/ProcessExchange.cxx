// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "ProcessExchange.h"

#include "Core/Model/Error.h"
#include "vtkMultiProcessController.h"

namespace bigus
{
namespace
{

void Require(int done)
{
  if (!done)
  {
    throw Error("The processes that train together could not exchange what they have.");
  }
}

}  // namespace

int ProcessExchange::Rank() const
{
  return controller_->GetLocalProcessId();
}

int ProcessExchange::Size() const
{
  return controller_->GetNumberOfProcesses();
}

void ProcessExchange::GatherTo(int root, const char* mine, std::size_t bytes, char* all)
{
  Require(controller_->Gather(mine, all, static_cast<vtkIdType>(bytes), root));
}

void ProcessExchange::GatherToAll(const char* mine, std::size_t bytes, char* all)
{
  Require(controller_->AllGather(mine, all, static_cast<vtkIdType>(bytes)));
}

}  // namespace bigus
