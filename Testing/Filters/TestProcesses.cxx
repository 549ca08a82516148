// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A controller of several processes where nothing is loaded by which they work together.
#include <gtest/gtest.h>

#include "Data/FieldData.h"
#include "Data/Processes.h"
#include "Support/ErrorObserver.h"
#include "Support/Fields.h"
#include "Support/Random.h"
#include "vtkBigusPhantomSource.h"
#include "vtkBigusReslice.h"
#include "vtkBigusTrainer.h"
#include "vtkDummyCommunicator.h"
#include "vtkDummyController.h"
#include "vtkErrorCode.h"
#include "vtkImageData.h"
#include "vtkNew.h"
#include "vtkObjectFactory.h"
#include "vtkPolyData.h"

namespace bigus::test
{
namespace
{

class TwoProcesses : public vtkDummyCommunicator
{
public:
  static TwoProcesses* New() { VTK_STANDARD_NEW_BODY(TwoProcesses); }

protected:
  TwoProcesses()
  {
    MaximumNumberOfProcesses = 2;
    NumberOfProcesses = 2;
  }
};

TEST(Processes, AloneAreNotEnoughForSeveral)
{
  vtkNew<TwoProcesses> communicator;
  vtkNew<vtkDummyController> controller;
  controller->SetCommunicator(communicator);
  ASSERT_EQ(controller->GetNumberOfProcesses(), 2);
  EXPECT_FALSE(HasExchange());

  vtkNew<vtkPolyData> field;
  Random random(3);
  FieldToPolyData(RandomField(random, 50, 10.0, 0.1, 1.0, 0.4), field);
  vtkNew<vtkBigusReslice> reslice;
  reslice->SetInputData(field);
  reslice->SetOutputExtent(0, 9, 0, 9, 0, 0);
  reslice->Update();
  EXPECT_EQ(reslice->GetOutput()->GetNumberOfPoints(), 100);
  reslice->SetController(controller);
  const ErrorObserver ofReslice(reslice);
  reslice->Update();
  EXPECT_NE(ofReslice.Text().find("link or load BIGUS::FiltersParallel"), std::string::npos) << ofReslice.Text();
  EXPECT_NE(reslice->GetErrorCode(), vtkErrorCode::NoError);

  vtkNew<vtkBigusPhantomSource> source;
  source->SetNumberOfFrames(8);
  source->SetFrameSize(32, 24);
  vtkNew<vtkBigusTrainer> trainer;
  trainer->SetInputConnection(source->GetOutputPort());
  trainer->SetController(controller);
  const ErrorObserver ofTrainer(trainer);
  trainer->Update();
  EXPECT_NE(ofTrainer.Text().find("has 2 processes"), std::string::npos) << ofTrainer.Text();
}

}  // namespace
}  // namespace bigus::test
