// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A field whose parts lie in several processes: what these agree on, and the sum of their pictures.
#ifndef BigusFieldParts_h
#define BigusFieldParts_h

#include <Eigen/Dense>
#include <cstddef>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include "Core/Engine/Engine.h"
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

/// What a field is rendered with: an engine for each chunk that this process has.
struct PartEngines
{
  FieldChunks chunks;
  TransferFunction transfer;  ///< of the whole field
  std::vector<std::unique_ptr<Engine>> engines;
};

/// A field that is whole: this process agrees with itself.
class FieldParts
{
public:
  virtual ~FieldParts() = default;

  /// Each process does its share. When one throws, all do: that one what it threw, the others an Error with its words.
  virtual void Agree(const std::function<void()>& share) const { share(); }

  /// Tells the others, if there are any, that this process's part could not be made; throws Error then.
  virtual void TellOfNoPart() const {}

  /// The smallest of each value over all processes.
  virtual void Least(double*, int) const {}

  /// Where the part lies in the field, and what holds for all of it; engines are left alone. Throws Error on every process
  /// unless the parts are those of one field.
  virtual void Join(vtkPolyData* part, const GaussianField& field, PartEngines& whole) const;

  /// Makes the engines hold their chunks of the part.
  virtual void SetField(const GaussianField& part, PartEngines& whole) const;

  /// Renders planes as they are, or a slab of them, of the whole field.
  virtual RenderPlanes PlanesOf(const PartEngines& whole, ViewOutput output) const;

  /// Bands may be as large as this process's clock allows.
  virtual bool FollowsClock() const { return true; }

  /// Whether all processes go on.
  virtual bool All(bool here) const { return here; }
};

/// All processes of a controller. Each member function is to be called by all of them. Pictures of chunks are added
/// pairwise along a binary tree over all chunks, whose number is a power of two. So the sum has the same bits however
/// many processes have the chunks.
class ProcessParts : public FieldParts
{
public:
  explicit ProcessParts(vtkMultiProcessController* controller) : controller_(controller) {}

  void Agree(const std::function<void()>& share) const override;
  void TellOfNoPart() const override;
  void Least(double* values, int count) const override;
  void Join(vtkPolyData* part, const GaussianField& field, PartEngines& whole) const override;
  void SetField(const GaussianField& part, PartEngines& whole) const override;
  RenderPlanes PlanesOf(const PartEngines& whole, ViewOutput output) const override;
  bool FollowsClock() const override { return false; }  // processes take the same bands
  bool All(bool here) const override;

private:
  int NumberOfProcesses() const;

  /// What the part says of its chunks; a part that says nothing is one chunk, and bits then depend on the number of
  /// processes. Throws Error on every process unless each chunk is on one process.
  FieldChunks ChunksOf(vtkPolyData* part, std::size_t gaussians) const;

  /// Throws Error on every process unless all parts have one transfer function and one beam. An empty part has any.
  void RequireOneField(const GaussianField& part, TransferFunction& transfer) const;

  /// Adds up pictures of `count` floats. `render(k, picture)` makes that of chunk k of this process, counted from 0. All
  /// processes get the sum.
  void Sum(const FieldChunks& chunks, std::size_t count, const std::function<void(int, float*)>& render,
           float* sum) const;

  /// One plane of the whole field.
  void Render(const PartEngines& whole, const SlicePlane& plane, const Engine::Window& window, ViewOutput output,
              float* image, float* coverage) const;

  vtkMultiProcessController* controller_;
};

}  // namespace bigus

#endif
