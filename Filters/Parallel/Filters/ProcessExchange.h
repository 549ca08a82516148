// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What processes that have one field together tell each other, by a controller of VTK.
#pragma once

#include "PeerExchange.h"
#include "vtkBigusFiltersParallelModule.h"  // for the ABI namespace

#ifdef VTK_ABI_NAMESPACE_BEGIN  // from VTK 9.2 on
VTK_ABI_NAMESPACE_BEGIN
#endif
class vtkMultiProcessController;
#ifdef VTK_ABI_NAMESPACE_END
VTK_ABI_NAMESPACE_END
#endif

namespace bigus
{

class ProcessExchange : public PeerExchange
{
public:
  /// The controller must outlive this.
  explicit ProcessExchange(vtkMultiProcessController* controller) : controller_(controller) {}

  int Rank() const override;
  int Size() const override;

protected:
  void GatherToAll(const char* mine, std::size_t bytes, char* all) override;
  void Swap(int other, const char* mine, std::size_t bytes, char* theirs) override;

private:
  vtkMultiProcessController* controller_;
};

}  // namespace bigus
