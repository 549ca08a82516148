// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "PipelineSupport.h"

#include "vtkAlgorithm.h"
#include "vtkDataObject.h"
#include "vtkErrorCode.h"
#include "vtkInformation.h"
#include "vtkInformationVector.h"
#include "vtkStreamingDemandDrivenPipeline.h"

namespace bigus
{

void RequestWholeInput(vtkInformationVector* connections)
{
  for (int i = 0; i < connections->GetNumberOfInformationObjects(); ++i)
  {
    vtkInformation* info = connections->GetInformationObject(i);
    if (info->Has(vtkStreamingDemandDrivenPipeline::WHOLE_EXTENT()))
    {
      int whole[6];
      info->Get(vtkStreamingDemandDrivenPipeline::WHOLE_EXTENT(), whole);
      info->Set(vtkStreamingDemandDrivenPipeline::UPDATE_EXTENT(), whole, 6);
    }
    info->Set(vtkStreamingDemandDrivenPipeline::UPDATE_PIECE_NUMBER(), 0);
    info->Set(vtkStreamingDemandDrivenPipeline::UPDATE_NUMBER_OF_PIECES(), 1);
    info->Set(vtkStreamingDemandDrivenPipeline::UPDATE_NUMBER_OF_GHOST_LEVELS(), 0);
  }
}

void ForgetRequests(vtkInformationVector* outputs)
{
  const int nothing[6] = {0, -1, 0, -1, 0, -1};
  for (int port = 0; port < outputs->GetNumberOfInformationObjects(); ++port)
  {
    outputs->GetInformationObject(port)->Set(vtkStreamingDemandDrivenPipeline::COMBINED_UPDATE_EXTENT(), nothing, 6);
  }
}

void ClearOutputs(vtkInformationVector* outputs)
{
  for (int port = 0; port < outputs->GetNumberOfInformationObjects(); ++port)
  {
    vtkDataObject::GetData(outputs, port)->Initialize();
  }
}

int Execute(vtkAlgorithm* filter, vtkInformationVector* outputs, const std::function<void()>& work)
{
  // Filters alone may set their code.
  struct Filter : vtkAlgorithm
  {
    static void SetCode(vtkAlgorithm* filter, unsigned long code) { (filter->*&Filter::SetErrorCode)(code); }
  };
  ClearOutputs(outputs);
  Filter::SetCode(filter, vtkErrorCode::NoError);
  try
  {
    work();
    return 1;
  }
  catch (const std::exception& error)
  {
    ClearOutputs(outputs);
    ForgetRequests(outputs);
    vtkErrorWithObjectMacro(filter, << error.what());
    Filter::SetCode(filter, vtkErrorCode::UserError);
    return 0;
  }
}

}  // namespace bigus
