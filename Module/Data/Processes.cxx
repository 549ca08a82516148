// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Data/Processes.h"

#include <string>

#include "Core/Model/Error.h"
#include "vtkMultiProcessController.h"

namespace bigus
{
namespace
{

ExchangeFactory& Factory()
{
  static ExchangeFactory factory = nullptr;
  return factory;
}

/// Processes that cannot hear each other.
class NoExchange final : public Exchange
{
public:
  explicit NoExchange(int size) : size_(size) {}
  int Size() const override { return size_; }
  void Together(const std::function<void()>&) override
  {
    throw Error(
        "The controller has " + std::to_string(size_) +
        " processes, and nothing is loaded by which they work together; link or load BIGUS::FiltersParallel, or "
        "set no controller.");
  }

private:
  int size_;
};

}  // namespace

void RegisterExchange(ExchangeFactory factory)
{
  Factory() = factory;
}

bool HasExchange()
{
  return Factory() != nullptr;
}

std::unique_ptr<Exchange> ExchangeOf(vtkMultiProcessController* controller)
{
  if (controller && Factory())
  {
    return Factory()(controller);
  }
  const int size = controller ? controller->GetNumberOfProcesses() : 1;
  return size > 1 ? std::make_unique<NoExchange>(size) : std::make_unique<Exchange>();
}

}  // namespace bigus
