// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The executive of filters that work in several processes at once. Private to Filters.
#ifndef BigusCollectiveExecutive_h
#define BigusCollectiveExecutive_h

#include <functional>

#include "vtkInformation.h"
#include "vtkObjectFactory.h"
#include "vtkStreamingDemandDrivenPipeline.h"

namespace bigus
{

/// Where an input cannot be made, the filter behind it is not asked for data, and other processes would wait for it.
class CollectiveExecutive : public vtkStreamingDemandDrivenPipeline
{
public:
  static CollectiveExecutive* New() { VTK_STANDARD_NEW_BODY(CollectiveExecutive); }
  vtkTypeMacro(CollectiveExecutive, vtkStreamingDemandDrivenPipeline);

  /// Called where a request failed in the filter or before it, with whether it was one for data or for information.
  std::function<void(bool)> Failed;

  vtkTypeBool ProcessRequest(vtkInformation* request, vtkInformationVector** inputs,
                             vtkInformationVector* outputs) override
  {
    const vtkTypeBool done = this->Superclass::ProcessRequest(request, inputs, outputs);
    if (!done && (request->Has(REQUEST_INFORMATION()) || request->Has(REQUEST_DATA())))
    {
      this->Failed(request->Has(REQUEST_DATA()));
    }
    return done;
  }
};

}  // namespace bigus

#endif
