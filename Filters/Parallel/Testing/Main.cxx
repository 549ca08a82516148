// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Runs the tests in every process that mpirun started. They fail where one process sees them fail.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "vtkCommunicator.h"
#include "vtkMPIController.h"
#include "vtkNew.h"

int main(int argumentCount, char** arguments)
{
  const tbb::global_control oneThreadEach(tbb::global_control::max_allowed_parallelism, 1);
  vtkNew<vtkMPIController> controller;
  controller->Initialize(&argumentCount, &arguments);
  vtkMultiProcessController::SetGlobalController(controller);
  testing::InitGoogleTest(&argumentCount, arguments);
  const int failed = RUN_ALL_TESTS();
  int anyFailed = 0;
  controller->AllReduce(&failed, &anyFailed, 1, vtkCommunicator::MAX_OP);
  controller->Finalize();
  return anyFailed;
}
