// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A field whose parts lie in the processes of a controller: what these agree on, and the sum of their pictures.
#ifndef BigusProcessParts_h
#define BigusProcessParts_h

#include "FieldParts.h"

namespace bigus
{

/// Pictures of chunks are added pairwise along a binary tree over all chunks, whose number is a power of two. So the sum has
/// the same bits however many processes have the chunks.
class ProcessParts final : public FieldParts
{
public:
  /// The controller must outlive this.
  explicit ProcessParts(vtkMultiProcessController* controller);

  void Join(vtkPolyData* part, const GaussianField& field, PartEngines& whole) const override;
  void SetField(const GaussianField& part, const ViewDependence* view, PartEngines& whole) const override;
  RenderPlanes PlanesOf(const PartEngines& whole, ViewOutput output) const override;

private:
  /// What the part says of its chunks; a part that says nothing is one chunk, and bits then depend on the number of
  /// processes. Throws Error on every process unless each chunk is on one process.
  FieldChunks ChunksOf(vtkPolyData* part, std::size_t gaussians) const;

  /// Throws Error on every process unless all parts have one transfer function, one beam and as many recorded
  /// views. An empty part has any.
  void RequireOneField(vtkPolyData* data, const GaussianField& part, TransferFunction& transfer) const;

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
