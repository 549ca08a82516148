// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Engine/ViewEngine.h"

namespace bigus
{
namespace
{

bool IsSameView(const SlicePlane& a, const SlicePlane& b)
{
  return a.origin == b.origin && a.columnStep == b.columnStep && a.rowStep == b.rowStep;
}

}  // namespace

SeenField::SeenField(Engine& engine, const GaussianField& field, const ViewDependence* view) : engine_(engine)
{
  engine.SetField(field);
  if (view)
  {
    viewed_.emplace(field, *view);
  }
}

double SeenField::LookFrom(const SlicePlane& plane)
{
  if (!viewed_ || (last_ && IsSameView(*last_, plane)))
  {
    return nearness_;
  }
  last_.reset();  // what throws leaves it to the next call
  const double nearness = viewed_->Nearness(plane);
  if (nearness > 0 || nearness_ > 0)  // else it is as it was uploaded
  {
    const std::vector<double> reflectivities = viewed_->At(plane, nearness);
    if (ViewEngine* const engine = ViewEngine::Of(engine_))
    {
      engine->SetReflectivities(reflectivities);
    }
    else
    {
      GaussianField field = engine_.GetField();
      field.reflectivities = reflectivities;
      engine_.SetField(field);
    }
  }
  nearness_ = nearness;
  last_ = plane;
  return nearness_;
}

}  // namespace bigus
