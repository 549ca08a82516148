// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A field whose parts lie in several processes: what these agree on, and the sum of their pictures.
#ifndef BigusFieldParts_h
#define BigusFieldParts_h

#include <Eigen/Dense>
#include <cstddef>
#include <functional>
#include <utility>
#include <vector>

#include "Core/Model/FieldChunks.h"
#include "Core/Model/GaussianField.h"
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

/// All processes of a controller. Each member function is to be called by all of them. Pictures of chunks are added
/// pairwise along a binary tree over all chunks, whose number is a power of two. So the sum has the same bits however
/// many processes have the chunks.
class FieldParts
{
public:
  explicit FieldParts(vtkMultiProcessController* controller) : controller_(controller) {}

  int NumberOfProcesses() const;

  /// Each process does its share. When one throws, all do: that one what it threw, the others an Error with its words.
  void Agree(const std::function<void()>& share) const;

  /// Whether all say so.
  bool All(bool here) const;

  /// The smallest of each value over all processes.
  void Least(double* values, int count) const;

  /// What the part says of its chunks; a part that says nothing is one chunk, and bits then depend on the number of
  /// processes. Throws Error on every process unless each chunk is on one process.
  FieldChunks ChunksOf(vtkPolyData* part, std::size_t gaussians) const;

  /// Throws Error on every process unless all parts have one transfer function and one beam. An empty part has any.
  void RequireOneField(const GaussianField& part, TransferFunction& transfer) const;

  /// Adds up pictures of `count` floats. `render(k, picture)` makes that of chunk k of this process, counted from 0. All
  /// processes get the sum.
  void Sum(const FieldChunks& chunks, std::size_t count, const std::function<void(int, float*)>& render,
           float* sum) const;

private:
  vtkMultiProcessController* controller_;
};

}  // namespace bigus

#endif
