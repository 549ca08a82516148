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
  const double before = nearness_;
  nearness_ = viewed_->Nearness(plane);
  last_ = plane;
  if (nearness_ == 0 && before == 0)
  {
    return 0;  // as it was uploaded
  }
  const std::vector<double> reflectivities = viewed_->At(plane, nearness_);
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
  return nearness_;
}

}  // namespace bigus
