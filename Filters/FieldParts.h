// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What a field is rendered with, where processes may have a part of it each. The class itself is a field that is whole.
#ifndef BigusFieldParts_h
#define BigusFieldParts_h

#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include "Core/Engine/Engine.h"
#include "Core/Engine/Exchange.h"
#include "Core/Engine/ViewEngine.h"
#include "Core/Model/FieldChunks.h"
#include "Core/Model/GaussianField.h"
#include "Core/Slicing/Bands.h"
#include "vtkBigusFiltersModule.h"  // for the ABI namespace

#ifdef VTK_ABI_NAMESPACE_BEGIN  // from VTK 9.2 on
VTK_ABI_NAMESPACE_BEGIN
#endif
class vtkMultiProcessController;
class vtkPolyData;
#ifdef VTK_ABI_NAMESPACE_END
VTK_ABI_NAMESPACE_END
#endif

namespace bigus
{

/// An engine for each chunk of the field that this process has.
struct PartEngines
{
  FieldChunks chunks;
  TransferFunction transfer;  ///< of the whole field
  std::vector<std::unique_ptr<Engine>> engines;
  std::vector<SeenField> seen;  ///< of each engine
};

/// Each member function is to be called by all processes.
class FieldParts
{
public:
  explicit FieldParts(std::unique_ptr<Exchange> others) : others_(std::move(others)) {}
  virtual ~FieldParts() = default;

  /// For the processes of the controller; null: the field is whole.
  static std::unique_ptr<FieldParts> Of(vtkMultiProcessController* controller);
  using Factory = std::unique_ptr<FieldParts> (*)(vtkMultiProcessController*);
  static void Register(Factory factory);

  /// Each process does its share. When one throws, all do: that one what it threw, the others an Error with its words.
  void Agree(const std::function<void()>& share) const { others_->Together(share); }

  /// Of the processes that have the parts.
  Exchange& Others() const { return *others_; }

  /// Whether all processes go on.
  bool All(bool here) const { return !others_->Any(!here); }

  /// The sum of each value, and the smallest, over all processes.
  void Sum(double* values, std::size_t count) const { others_->Sum(values, count); }
  void Least(double* values, std::size_t count) const;

  /// Bands may be as large as this process's clock allows; several processes take the same.
  bool FollowsClock() const { return others_->IsAlone(); }

  /// Where the part lies in the field, and what holds for all of it; engines are left alone. Throws Error on every process
  /// unless the parts are those of one field.
  virtual void Join(vtkPolyData* part, const GaussianField& field, PartEngines& whole) const;

  /// Makes the engines hold their chunks of the part, seen as `view` says, unless that is null.
  virtual void SetField(const GaussianField& part, const ViewDependence* view, PartEngines& whole) const;

  /// Renders planes as they are, or a slab of them, of the whole field.
  virtual RenderPlanes PlanesOf(const PartEngines& whole, ViewOutput output) const;

protected:
  std::unique_ptr<Exchange> others_;
};

}  // namespace bigus

#endif
