// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Engines whose Gaussians may have other reflectivities on every plane.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "Core/Engine/Engine.h"
#include "Core/Model/ViewDependence.h"

namespace bigus
{

/// What an Engine may be besides; found by ViewEngine::Of. Kernels know nothing of it: reflectivities of a plane are made
/// before its walk, and derivatives by them are told after it. Not for parts of a field.
class ViewEngine
{
public:
  virtual ~ViewEngine() = default;

  /// Null where the engine is none.
  static ViewEngine* Of(Engine& engine) { return dynamic_cast<ViewEngine*>(&engine); }

  /// The field's, [FieldSize()].
  virtual std::vector<double> Reflectivities() const = 0;

  /// From now on the field has these [FieldSize()]; all else, what the optimizer knows included, stays.
  virtual void SetReflectivities(const std::vector<double>& reflectivities) = 0;

  /// Engine::Backpropagate where frame f sees `reflectivities` [frames][FieldSize()]. `derivatives`, as many, become the
  /// loss's by them: moment m0 of the Formula page. The gradient is that of a field of which each r_i has every plane's
  /// r_i(P) move with it, so Engine::Step takes geometry and r on.
  virtual double Backpropagate(const std::vector<int>& frames, const Loss& loss,
                               const std::vector<float>& reflectivities, std::vector<float>& derivatives) = 0;

  /// Replaces S in a row of a frame, [width] from column 0, by what is to be gathered. f counts in `frames`. Called for
  /// different rows at the same time.
  using ChangeRow = std::function<void(std::size_t f, int row, float* line)>;

  /// S of the frames at these reflectivities, changed row by row, and the sums over pixels of that times each Gaussian's
  /// footprint into `sums` [frames][FieldSize()], unless null. Footprints are those of the reflectivities given and of the
  /// field's own, whichever are larger; so one linear map and its transpose.
  virtual void Walk(const std::vector<int>& frames, const std::vector<float>& reflectivities, const ChangeRow& change,
                    std::vector<float>* sums) = 0;
};

/// A field on an engine, which need not be a ViewEngine, seen from one plane after another.
class SeenField
{
public:
  /// Uploads the field. Without a view it looks alike from everywhere. The engine must outlive this. Throws Error unless
  /// the view is the field's.
  SeenField(Engine& engine, const GaussianField& field, const ViewDependence* view);

  /// Gives the field on the engine the reflectivities that this plane sees. Returns a(P), 0 without a view.
  double LookFrom(const SlicePlane& plane);

private:
  Engine& engine_;
  std::optional<ViewedReflectivities> viewed_;
  std::optional<SlicePlane> last_;
  double nearness_ = 0;
};

}  // namespace bigus
