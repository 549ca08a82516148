// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// How a field is split among processes and files.
#pragma once

#include <cstddef>
#include <vector>

#include "Core/Model/GaussianField.h"

namespace bigus
{

struct ViewDependence;

/// Chunks that a whole field is split into, and those of them that one part of it has. S is linear in the Gaussians, so
/// pictures of chunks add up to the field's.
struct FieldChunks
{
  int total = 1;                   ///< 1 to kMost
  int first = 0;                   ///< of this part
  std::vector<std::size_t> sizes;  ///< Gaussians of each that this part has, in its order

  static constexpr int kMost = 4096;
  static constexpr int kUsual = 16;
};

/// Gaussians that follow each other in the field, and in a chunk. Neighbours in the field, which lie near each other, stay
/// together, and blocks are dealt to the chunks in turn, so that every chunk has a share of every slice.
constexpr std::size_t kChunkBlock = 256;

/// Throws Error unless `total` is 1 to FieldChunks::kMost, and `piece` one of `pieces`, counted from 0.
void RequireChunks(int total, int piece, int pieces);

/// The same where a field is split anew: then `total` is a power of two, so that pictures of chunks are added as a tree.
void RequirePartition(int total, int piece, int pieces);

/// The chunks of piece `piece` of `pieces`: all chunks in turn, as evenly as they can be dealt.
FieldChunks ChunksOfPiece(int total, int piece, int pieces);

/// Fills in how many of `gaussians` each of the chunks has.
void CountChunks(std::size_t gaussians, FieldChunks& chunks);

/// The Gaussians of these chunks, one chunk after the other, and the sizes of the chunks.
GaussianField PartOf(const GaussianField& field, FieldChunks& chunks);
/// What the field knows of directions, of those Gaussians.
ViewDependence PartOf(const ViewDependence& view, FieldChunks& chunks);

}  // namespace bigus
