// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "ProcessParts.h"

#include <algorithm>
#include <limits>
#include <string>

#include "Core/Model/Error.h"
#include "Data/FieldData.h"
#include "ProcessExchange.h"
#include "vtkDataArray.h"
#include "vtkFieldData.h"
#include "vtkMultiProcessController.h"
#include "vtkPolyData.h"

namespace bigus
{
namespace
{

constexpr int kNodesTag = 7101, kPicturesTag = 7102;  // of messages to the first process

bool IsPowerOfTwo(int number)
{
  return number > 0 && (number & (number - 1)) == 0;
}

/// The sum over 2^level chunks from `place` 2^level on.
struct Node
{
  int level, place;
  std::vector<float> picture;
};

/// Adds a node to those before it, whose chunks end where its own begin, and joins what belongs to one parent.
void Push(std::vector<Node>& nodes, Node node)
{
  while (!nodes.empty() && nodes.back().level == node.level && node.place % 2 == 1 &&
         nodes.back().place == node.place - 1)
  {
    Node& left = nodes.back();
    for (std::size_t p = 0; p < left.picture.size(); ++p)
    {
      left.picture[p] += node.picture[p];
    }
    node = {node.level + 1, node.place / 2, std::move(left.picture)};
    nodes.pop_back();
  }
  nodes.push_back(std::move(node));
}

template <class Value>
std::vector<Value> Slice(const std::vector<Value>& values, std::size_t first, std::size_t count)
{
  const auto begin = values.begin() + static_cast<std::ptrdiff_t>(first);
  return std::vector<Value>(begin, begin + static_cast<std::ptrdiff_t>(count));
}

/// Gaussians from `first` on.
GaussianField Slice(const GaussianField& field, std::size_t first, std::size_t count)
{
  const auto part = [first, count](const auto& values) { return Slice(values, first, count); };
  return {part(field.means),          part(field.scales), part(field.rotations),
          part(field.reflectivities), field.beam,         field.transfer};
}

}  // namespace

ProcessParts::ProcessParts(vtkMultiProcessController* controller)
    : FieldParts(std::make_unique<ProcessExchange>(controller)), controller_(controller)
{
}

FieldChunks ProcessParts::ChunksOf(vtkPolyData* part, std::size_t gaussians) const
{
  const int here = others_->Rank(), processes = others_->Size();
  FieldChunks chunks;
  Agree(
      [&]
      {
        vtkDataArray* const array = part->GetFieldData()->GetArray(kChunksArray);
        if (!array)
        {
          while (chunks.total < processes)
          {
            chunks.total *= 2;
          }
          chunks.first = here;
          // The last one has the empty chunks as well that fill the tree.
          chunks.sizes.resize(static_cast<std::size_t>(here + 1 == processes ? chunks.total - here : 1));
          chunks.sizes[0] = gaussians;
          return;
        }
        const auto value = [array](vtkIdType k) { return k < array->GetNumberOfTuples() ? array->GetTuple1(k) : -1.0; };
        chunks.total = static_cast<int>(std::clamp(value(0), -1.0, 1e9));
        chunks.first = static_cast<int>(std::clamp(value(1), -1.0, 1e9));
        double sum = 0;
        for (vtkIdType k = 2; k < std::min<vtkIdType>(array->GetNumberOfTuples(), 2 + FieldChunks::kMost); ++k)
        {
          chunks.sizes.push_back(static_cast<std::size_t>(std::clamp(value(k), 0.0, 1e12)));
          sum += value(k);
        }
        Require(IsPowerOfTwo(chunks.total) && chunks.total <= FieldChunks::kMost && chunks.first >= 0 &&
                    chunks.first + chunks.sizes.size() <= static_cast<std::size_t>(chunks.total) &&
                    sum == static_cast<double>(gaussians),
                "The field data array Chunks does not fit the ", gaussians,
                " Gaussians of this part; make parts with vtkBigusPartitionField.");
      });
  // Each chunk on one process: begins and ends, in the order of the processes.
  std::vector<int> all(3 * static_cast<std::size_t>(processes));
  const int mine[3] = {chunks.total, chunks.first, static_cast<int>(chunks.sizes.size())};
  controller_->AllGather(mine, all.data(), 3);
  int next = 0;
  for (int process = 0; process < processes; ++process)
  {
    const int *const of = &all[3 * static_cast<std::size_t>(process)], total = of[0], first = of[1], count = of[2];
    if (total != all[0] || (count > 0 && first != next))
    {
      throw Error("The parts of the field do not follow each other: process " + std::to_string(process) +
                  " has chunks from " + std::to_string(first) + " of " + std::to_string(total) + ", and " +
                  std::to_string(next) + " of " + std::to_string(all[0]) +
                  " is next; make parts with "
                  "vtkBigusPartitionField, a piece for each process in its order.");
    }
    next += count;
  }
  Require(next == all[0], "The parts of the field end with chunk ", next, " of ", all[0],
          "; make parts with vtkBigusPartitionField, one piece for each process.");
  return chunks;
}

void ProcessParts::RequireOneField(vtkPolyData* data, const GaussianField& part, TransferFunction& transfer) const
{
  vtkDataArray* const views = data->GetFieldData()->GetArray("ViewPoses");
  const Beam& beam = part.beam;
  const double says[] = {part.transfer.gamma, beam.elevationSigma, beam.probeElevationSigma,
                         static_cast<double>(beam.trainedNormals.size()),
                         static_cast<double>(views ? views->GetNumberOfTuples() : 0)};
  constexpr int kCount = 5;
  double least[2 * kCount];  // the values, and their negatives
  for (int k = 0; k < kCount; ++k)
  {
    const bool isEmpty = part.Size() == 0;
    least[k] = isEmpty ? std::numeric_limits<double>::infinity() : says[k];
    least[kCount + k] = isEmpty ? std::numeric_limits<double>::infinity() : -says[k];
  }
  Least(least, 2 * kCount);
  static const char* const kNames[] = {"Gamma", "ElevationSigma", "ProbeElevationSigma", "TrainedNormals",
                                       "number of ViewPoses"};
  for (int k = 0; k < kCount; ++k)
  {
    Require(least[k] == -least[kCount + k] || !(least[k] < std::numeric_limits<double>::infinity()),
            "The processes hold parts of different fields: ", kNames[k], " is ", least[k], " and ", -least[kCount + k],
            ".");
  }
  transfer = part.transfer;
  if (least[0] < std::numeric_limits<double>::infinity())
  {
    transfer.gamma = least[0];
  }
}

void ProcessParts::Sum(const FieldChunks& chunks, std::size_t count, const std::function<void(int, float*)>& render,
                       float* sum) const
{
  std::vector<Node> nodes;
  Agree(
      [&]
      {
        for (int k = 0; k < static_cast<int>(chunks.sizes.size()); ++k)
        {
          Node leaf{0, chunks.first + k, std::vector<float>(count)};
          render(k, leaf.picture.data());
          Push(nodes, std::move(leaf));
        }
      });
  const int here = others_->Rank();
  const auto length = static_cast<vtkIdType>(count);
  if (here > 0)
  {
    std::vector<int> places{static_cast<int>(nodes.size())};
    for (const Node& node : nodes)
    {
      places.push_back(node.level);
      places.push_back(node.place);
    }
    controller_->Send(places.data(), 1, 0, kNodesTag);
    controller_->Send(places.data() + 1, static_cast<vtkIdType>(places.size()) - 1, 0, kNodesTag);
    for (const Node& node : nodes)
    {
      controller_->Send(node.picture.data(), length, 0, kPicturesTag);
    }
  }
  else
  {
    for (int process = 1; process < others_->Size(); ++process)
    {
      int number = 0;
      controller_->Receive(&number, 1, process, kNodesTag);
      std::vector<int> places(2 * static_cast<std::size_t>(number));
      controller_->Receive(places.data(), static_cast<vtkIdType>(places.size()), process, kNodesTag);
      for (int k = 0; k < number; ++k)
      {
        Node node{places[2 * static_cast<std::size_t>(k)], places[2 * static_cast<std::size_t>(k) + 1],
                  std::vector<float>(count)};
        controller_->Receive(node.picture.data(), length, process, kPicturesTag);
        Push(nodes, std::move(node));
      }
    }
    std::copy_n(nodes[0].picture.data(), count, sum);  // the root: ChunksOf saw that all chunks are there
  }
  controller_->Broadcast(sum, length, 0);
}

void ProcessParts::Join(vtkPolyData* part, const GaussianField& field, PartEngines& whole) const
{
  whole.chunks = ChunksOf(part, field.Size());
  RequireOneField(part, field, whole.transfer);
}

void ProcessParts::SetField(const GaussianField& part, const ViewDependence* view, PartEngines& whole) const
{
  std::size_t first = 0;
  whole.seen.clear();
  for (std::size_t k = 0; k < whole.engines.size(); ++k)
  {
    const std::size_t count = whole.chunks.sizes[k];
    ViewDependence ofChunk;
    if (view)
    {
      ofChunk = {view->views, Slice(view->terms, first, count)};
    }
    whole.seen.emplace_back(*whole.engines[k], Slice(part, first, count), view ? &ofChunk : nullptr);
    first += count;
  }
}

RenderPlanes ProcessParts::PlanesOf(const PartEngines& whole, ViewOutput output) const
{
  return [this, &whole, output](const std::vector<SlicePlane>& planes, const Engine::Window& window, float* image,
                                float* coverage)
  {
    const std::size_t size = static_cast<std::size_t>(window.rows) * window.columns;
    for (std::size_t i = 0; i < planes.size(); ++i)
    {
      Render(whole, planes[i], window, output, image + i * size, coverage ? coverage + i * size : nullptr);
    }
  };
}

void ProcessParts::Render(const PartEngines& whole, const SlicePlane& plane, const Engine::Window& window,
                          ViewOutput output, float* image, float* coverage) const
{
  // Scattering and coverage are linear in the Gaussians, and intensity follows from the sum.
  const std::size_t pixels = static_cast<std::size_t>(window.rows) * window.columns;
  std::vector<float> sum((coverage ? 2 : 1) * pixels);
  Sum(
      whole.chunks, sum.size(),
      [&](int k, float* picture) {
        whole.engines[k]->Render(plane, window, ViewOutput::Scattering, picture, coverage ? picture + pixels : nullptr);
      },
      sum.data());
  for (std::size_t p = 0; p < pixels; ++p)
  {
    image[p] = output == ViewOutput::Intensity ? whole.transfer.Intensity(sum[p]) : sum[p];
  }
  if (coverage)
  {
    std::copy(sum.begin() + static_cast<std::ptrdiff_t>(pixels), sum.end(), coverage);
  }
}

}  // namespace bigus
