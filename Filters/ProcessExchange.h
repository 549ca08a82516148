// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What processes tell each other while they train one field, by a controller of VTK. Private to Filters.
#ifndef BigusProcessExchange_h
#define BigusProcessExchange_h

#include "Core/Engine/Exchange.h"

class vtkMultiProcessController;

namespace bigus
{

class ProcessExchange : public Exchange
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

#endif
