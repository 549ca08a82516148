// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Model/FieldChunks.h"

#include <algorithm>
#include <string>

#include "Core/Model/Error.h"
#include "Core/Model/ViewDependence.h"

namespace bigus
{

void RequireChunks(int total, int piece, int pieces)
{
  Require(total >= 1 && total <= FieldChunks::kMost, "A field of ", total, " chunks was asked for; 1 to ",
          FieldChunks::kMost, " are possible.");
  Require(pieces >= 1 && piece >= 0 && piece < pieces, "Piece is ", piece, " of NumberOfPieces ", pieces,
          "; pieces are counted from 0.");
}

void RequirePartition(int total, int piece, int pieces)
{
  Require(total >= 1 && total <= FieldChunks::kMost && (total & (total - 1)) == 0, "NumberOfChunks is ", total,
          "; it must be a power of two from 1 to ", FieldChunks::kMost, ".");
  RequireChunks(total, piece, pieces);
}

FieldChunks ChunksOfPiece(int total, int piece, int pieces)
{
  FieldChunks chunks;
  chunks.total = total;
  const auto begin = [&](int p) { return static_cast<int>(static_cast<long>(total) * p / pieces); };
  chunks.first = begin(piece);
  chunks.sizes.resize(static_cast<std::size_t>(begin(piece + 1) - begin(piece)));
  return chunks;
}

void CountChunks(std::size_t gaussians, FieldChunks& chunks)
{
  const std::size_t round = kChunkBlock * static_cast<std::size_t>(chunks.total);  // a block for every chunk
  const std::size_t rest = gaussians % round;
  for (std::size_t k = 0; k < chunks.sizes.size(); ++k)
  {
    const std::size_t begin = kChunkBlock * (static_cast<std::size_t>(chunks.first) + k);
    chunks.sizes[k] = gaussians / round * kChunkBlock + std::min(kChunkBlock, rest > begin ? rest - begin : 0);
  }
}

namespace
{

/// Their numbers in a field of `gaussians`.
std::vector<std::size_t> GaussiansOf(std::size_t gaussians, FieldChunks& chunks)
{
  std::vector<std::size_t> numbers;
  CountChunks(gaussians, chunks);
  for (std::size_t k = 0; k < chunks.sizes.size(); ++k)
  {
    const std::size_t first = kChunkBlock * (static_cast<std::size_t>(chunks.first) + k);
    for (std::size_t block = first; block < gaussians; block += kChunkBlock * static_cast<std::size_t>(chunks.total))
    {
      for (std::size_t i = block; i < std::min(block + kChunkBlock, gaussians); ++i)
      {
        numbers.push_back(i);
      }
    }
  }
  return numbers;
}

}  // namespace

GaussianField PartOf(const GaussianField& field, FieldChunks& chunks)
{
  return field.Pick(GaussiansOf(field.Size(), chunks));
}

ViewDependence PartOf(const ViewDependence& view, FieldChunks& chunks)
{
  ViewDependence part{view.views, {}};
  for (const std::size_t i : GaussiansOf(view.terms.size(), chunks))
  {
    part.terms.push_back(view.terms[i]);
  }
  return part;
}

}  // namespace bigus
