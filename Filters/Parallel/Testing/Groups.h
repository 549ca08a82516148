// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The processes of a test that mpirun started, and groups of them.
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <string>

#include "vtkMPIController.h"
#include "vtkNew.h"
#include "vtkProcessGroup.h"
#include "vtkSmartPointer.h"

namespace bigus::test
{

/// All processes that mpirun started.
inline vtkMPIController* World()
{
  static vtkMPIController* const world =
      vtkMPIController::SafeDownCast(vtkMultiProcessController::GetGlobalController());
  return world;
}

/// Runs a test with the first 1, 2, 3 and 4 processes.
inline void WithGroups(const std::function<void(vtkMultiProcessController*)>& test)
{
  for (int processes = 1; processes <= World()->GetNumberOfProcesses(); ++processes)
  {
    SCOPED_TRACE(std::to_string(processes) + " processes");
    vtkNew<vtkProcessGroup> group;
    group->Initialize(World());
    group->RemoveAllProcessIds();
    for (int id = 0; id < processes; ++id)
    {
      group->AddProcessId(id);
    }
    vtkSmartPointer<vtkMultiProcessController> controller;
    controller.TakeReference(World()->CreateSubController(group));
    if (controller)
    {
      test(controller);
    }
    World()->Barrier();
  }
}

}  // namespace bigus::test
