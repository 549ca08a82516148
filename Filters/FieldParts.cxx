// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "FieldParts.h"

#include <algorithm>
#include <cstring>
#include <string>

#include "Data/Processes.h"
#include "vtkPolyData.h"

namespace bigus
{
namespace
{

FieldParts::Factory& RegisteredFactory()
{
  static FieldParts::Factory factory = nullptr;
  return factory;
}

}  // namespace

std::unique_ptr<FieldParts> FieldParts::Of(vtkMultiProcessController* controller)
{
  return controller && RegisteredFactory() ? RegisteredFactory()(controller)
                                           : std::make_unique<FieldParts>(ExchangeOf(controller));
}

void FieldParts::Register(Factory factory)
{
  RegisteredFactory() = factory;
}

void FieldParts::Least(double* values, std::size_t count) const
{
  const std::size_t bytes = count * sizeof(double);
  for (const std::string& numbers : others_->Gather({reinterpret_cast<const char*>(values), bytes}))
  {
    for (std::size_t k = 0; k < count; ++k)
    {
      double number;
      std::memcpy(&number, numbers.data() + k * sizeof(double), sizeof(double));
      values[k] = std::min(values[k], number);
    }
  }
}

void FieldParts::Join(vtkPolyData*, const GaussianField& field, PartEngines& whole) const
{
  whole.chunks = {};
  whole.chunks.sizes = {field.Size()};
  whole.transfer = field.transfer;
}

void FieldParts::SetField(const GaussianField& part, const ViewDependence* view, PartEngines& whole) const
{
  whole.seen.clear();
  whole.seen.emplace_back(*whole.engines[0], part, view);
}

RenderPlanes FieldParts::PlanesOf(const PartEngines& whole, ViewOutput output) const
{
  return PlanesOn(*whole.engines[0], output);
}

}  // namespace bigus
