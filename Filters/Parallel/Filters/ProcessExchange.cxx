// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "ProcessExchange.h"

#include "Core/Model/Error.h"
#include "vtkMultiProcessController.h"

namespace bigus
{
namespace
{

constexpr int kSwapTag = 7103;  // beside those of ProcessParts.cxx

void Require(int done)
{
  bigus::Require(done, "The processes that have one field together could not exchange what they have.");
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

void ProcessExchange::GatherToAll(const char* mine, std::size_t bytes, char* all)
{
  Require(controller_->AllGather(mine, all, static_cast<vtkIdType>(bytes)));
}

void ProcessExchange::Swap(int other, const char* mine, std::size_t bytes, char* theirs)
{
  const auto length = static_cast<vtkIdType>(bytes);
  if (Rank() < other)  // both may wait until the other takes what they send
  {
    Require(controller_->Send(mine, length, other, kSwapTag));
    Require(controller_->Receive(theirs, length, other, kSwapTag));
  }
  else
  {
    Require(controller_->Receive(theirs, length, other, kSwapTag));
    Require(controller_->Send(mine, length, other, kSwapTag));
  }
}

}  // namespace bigus
