// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "PartEngine.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "Core/Engine/Exchange.h"
#include "Core/Engine/FieldState.h"
#include "Core/Engine/MortonOrder.h"
#include "Core/Engine/ViewEngine.h"
#include "Core/Formula/GaussianBlock.h"
#include "Core/Model/Error.h"
#include "Core/Numerics/StateBytes.h"

namespace bigus
{
namespace
{

using Places = std::vector<std::uint32_t>;

/// Numbers of every process, one process after the other.
template <class Value>
std::vector<Value> GatherValues(Exchange& exchange, const std::vector<Value>& mine)
{
  const std::string bytes(reinterpret_cast<const char*>(mine.data()), mine.size() * sizeof(Value));
  std::vector<Value> all;
  for (const std::string& part : exchange.Gather(bytes))
  {
    const std::size_t before = all.size();
    all.resize(before + part.size() / sizeof(Value));
    if (!part.empty())
    {
      std::memcpy(static_cast<void*>(all.data() + before), part.data(), part.size());
    }
  }
  return all;
}

/// Where the Gaussians of all processes lie in the whole field. Throws Error unless they fill it, each at one place: a
/// state that was read may say anything.
Places GatherPlaces(Exchange& exchange, const Places& mine)
{
  Places all = GatherValues(exchange, mine);
  std::vector<bool> taken(all.size(), false);
  for (const std::uint32_t place : all)
  {
    StateReader::Require(place < taken.size() && !taken[place], "parts that are not those of one field");
    taken[place] = true;
  }
  return all;
}

/// The same, put where `places`, which were gathered too, say.
template <class Value>
std::vector<Value> GatherInPlace(Exchange& exchange, const std::vector<Value>& mine, const Places& places)
{
  const std::vector<Value> all = GatherValues(exchange, mine);
  std::vector<Value> whole(all.size());
  for (std::size_t k = 0; k < all.size(); ++k)
  {
    whole[places[k]] = all[k];
  }
  return whole;
}

class PartEngine final : public Engine, public ViewEngine
{
public:
  PartEngine(const std::string& name, Exchange& exchange) : exchange_(exchange), own_(Engine::Create(name))
  {
    own_->SetExchange(&exchange);
  }

  std::string Device() const override
  {
    return own_->Device() + " in each of " + std::to_string(exchange_.Size()) + " processes";
  }

  void SetField(const GaussianField& field, const std::vector<int>* parents) override
  {
    if (parents && parents->size() != field.Size())
    {
      throw Error("Engine: " + std::to_string(parents->size()) + " parents for " + std::to_string(field.Size()) +
                  " Gaussians.");
    }
    const std::vector<int> owners = parents ? OwnersOfParents(*parents) : std::vector<int>(field.Size(), -1);
    Places places = PlacesOf(field, owners);
    transfer_ = field.transfer;
    beam_ = field.beam;
    size_ = field.Size();
    if (!parents)
    {
      places_ = std::move(places);
      own_->SetField(field.Pick(places_));
      return;
    }
    std::vector<int> ownParents;
    for (const std::uint32_t place : places)
    {
      const auto parent = (*parents)[place] >= 0
                              ? std::lower_bound(places_.begin(), places_.end(), std::uint32_t((*parents)[place]))
                              : places_.end();
      const bool isHere = parent != places_.end() && *parent == static_cast<std::uint32_t>((*parents)[place]);
      ownParents.push_back(isHere ? static_cast<int>(parent - places_.begin()) : -1);
    }
    places_ = std::move(places);
    own_->SetField(field.Pick(places_), &ownParents);
  }

  GaussianField GetField() const override { return Gather(GetPart()); }
  std::size_t FieldSize() const override { return size_; }
  FieldPart GetPart() const override { return {own_->GetField(), places_}; }

  void SetPart(const GaussianField& part) override
  {
    Require(part.Size() == places_.size(), "Engine: a part of ", part.Size(), " Gaussians instead of ", places_.size(),
            ".");
    own_->SetField(part);
  }

  GaussianField Gather(FieldPart part) const override
  {
    const Places places = GatherPlaces(exchange_, part.places);
    GaussianField field;
    field.transfer = transfer_;
    field.beam = beam_;
    field.means = GatherInPlace(exchange_, part.field.means, places);
    field.scales = GatherInPlace(exchange_, part.field.scales, places);
    field.rotations = GatherInPlace(exchange_, part.field.rotations, places);
    field.reflectivities = GatherInPlace(exchange_, part.field.reflectivities, places);
    return field;
  }

  void SetAccuracy(const Accuracy& accuracy) override
  {
    Accuracy share = accuracy;
    share.tolerance /= accuracy.perSplat ? 1 : exchange_.Size();
    own_->SetAccuracy(share);
  }

  void Render(const SlicePlane& plane, const Window& window, ViewOutput output, float* image, float* coverage) override
  {
    own_->Render(plane, window, ViewOutput::Scattering, image, coverage);
    const std::size_t pixels = static_cast<std::size_t>(window.columns) * window.rows;
    exchange_.Sum(image, pixels);
    if (output == ViewOutput::Intensity)
    {
      std::transform(image, image + pixels, image, [this](float s) { return transfer_.Intensity(s); });
    }
    if (coverage)
    {
      exchange_.Sum(coverage, pixels);
    }
  }

  void SetFrames(std::shared_ptr<const Sweep> sweep) override { own_->SetFrames(std::move(sweep)); }

  double Backpropagate(const std::vector<int>& frames, const Loss& loss) override
  {
    return own_->Backpropagate(frames, loss);
  }

  void Step(const LearningRates& rates, const ParameterLimits& limits) override { own_->Step(rates, limits); }

  double TrainStep(const std::vector<int>& frames, const Loss& loss, const LearningRates& rates,
                   const ParameterLimits& limits) override
  {
    return own_->TrainStep(frames, loss, rates, limits);
  }

  std::uint64_t GuardedUpdates() const override
  {
    auto updates = static_cast<double>(own_->GuardedUpdates());
    exchange_.Sum(&updates, 1);
    return static_cast<std::uint64_t>(updates);
  }

  std::size_t MemoryUse() const override { return own_->MemoryUse() + places_.capacity() * sizeof(places_[0]); }

  /// Of this process's part alone. All are loaded in as many processes.
  void SaveState(StateWriter& to) const override
  {
    to.Array(places_);
    to.Number(transfer_.gamma);
    SaveBeam(beam_, to);
    own_->SaveState(to);
  }

  void LoadState(StateReader& from) override
  {
    Places places = from.Array<std::uint32_t>();
    TransferFunction transfer;
    transfer.gamma = from.Number<double>();
    Beam beam = LoadBeam(from);
    own_->LoadState(from);
    StateReader::Require(std::is_sorted(places.begin(), places.end()) && places.size() == own_->FieldSize(),
                         "places of other Gaussians");
    size_ = GatherPlaces(exchange_, places).size();
    places_ = std::move(places);
    transfer_ = transfer;
    beam_ = std::move(beam);
  }

  FieldGradient GetGradient() const override
  {
    const FieldGradient own = own_->GetGradient();
    const Places places = GatherValues(exchange_, places_);
    FieldGradient gradient;
    gradient.means = GatherInPlace(exchange_, own.means, places);
    gradient.logScales = GatherInPlace(exchange_, own.logScales, places);
    gradient.rotations = GatherInPlace(exchange_, own.rotations, places);
    gradient.reflectivities = GatherInPlace(exchange_, own.reflectivities, places);
    return gradient;
  }

  Scores GetScores() const override
  {
    const Scores own = own_->GetScores();
    const Places places = GatherValues(exchange_, places_);
    Scores scores;
    scores.error = GatherInPlace(exchange_, own.error, places);
    scores.descent = GatherInPlace(exchange_, own.descent, places);
    scores.visits = GatherInPlace(exchange_, own.visits, places);
    return scores;
  }

  void ResetScores() override { own_->ResetScores(); }

  std::vector<double> Reflectivities() const override
  {
    return GatherInPlace(exchange_, OwnViews().Reflectivities(), GatherValues(exchange_, places_));
  }

  void SetReflectivities(const std::vector<double>& reflectivities) override
  {
    OwnViews().SetReflectivities(Own(reflectivities));
  }

  double Backpropagate(const std::vector<int>& frames, const Loss& loss, const std::vector<float>& reflectivities,
                       std::vector<float>& derivatives) override
  {
    std::vector<float> own;
    const double value = OwnViews().Backpropagate(frames, loss, Own(reflectivities), own);
    derivatives = OfAll(own, frames.size());
    return value;
  }

  void Walk(const std::vector<int>& frames, const std::vector<float>& reflectivities, const ChangeRow& change,
            std::vector<float>* sums) override
  {
    std::vector<float> own;
    OwnViews().Walk(frames, Own(reflectivities), change, sums ? &own : nullptr);
    if (sums)
    {
      *sums = OfAll(own, frames.size());
    }
  }

private:
  ViewEngine& OwnViews() const { return *ViewEngine::Of(*own_); }

  /// Of [frames][size_] the numbers of this process's Gaussians.
  template <class Value>
  std::vector<Value> Own(const std::vector<Value>& all) const
  {
    std::vector<Value> own;
    for (std::size_t first = 0; first < all.size(); first += size_)
    {
      for (const std::uint32_t place : places_)
      {
        own.push_back(all[first + place]);
      }
    }
    return own;
  }

  /// [frames][size_] of what each process has of its own Gaussians.
  std::vector<float> OfAll(const std::vector<float>& own, std::size_t frames) const
  {
    const Places places = GatherValues(exchange_, places_);
    std::vector<float> all;
    for (std::size_t f = 0; f < frames; ++f)
    {
      const float* first = own.data() + f * places_.size();
      const std::vector<float> one =
          GatherInPlace(exchange_, std::vector<float>(first, first + places_.size()), places);
      all.insert(all.end(), one.begin(), one.end());
    }
    return all;
  }

  /// For every Gaussian the process whose optimizer state it inherits, or -1.
  std::vector<int> OwnersOfParents(const std::vector<int>& parents) const
  {
    const std::vector<std::string> all =
        exchange_.Gather({reinterpret_cast<const char*>(places_.data()), places_.size() * sizeof(places_[0])});
    std::vector<int> owners(size_, -1);
    for (std::size_t rank = 0; rank < all.size(); ++rank)
    {
      for (std::size_t at = 0; at < all[rank].size(); at += sizeof(std::uint32_t))
      {
        std::uint32_t place;
        std::memcpy(&place, all[rank].data() + at, sizeof(place));
        owners[place] = static_cast<int>(rank);
      }
    }
    std::vector<int> ofParents;
    ofParents.reserve(parents.size());
    for (const int parent : parents)
    {
      ofParents.push_back(parent >= 0 && static_cast<std::size_t>(parent) < size_ ? owners[parent] : -1);
    }
    return ofParents;
  }

  /// What this process gets of the field, in order: what belongs to it, and of the rest its share. Neighbours stay
  /// together in blocks, and the process with the fewest Gaussians gets the next block. So every process has its share of
  /// every frame, and blocks are as compact as those of the whole field.
  Places PlacesOf(const GaussianField& field, const std::vector<int>& owners) const
  {
    std::vector<std::size_t> counts(static_cast<std::size_t>(exchange_.Size()), 0);
    Places places;
    const auto add = [&](std::uint32_t i, int owner)
    {
      ++counts[static_cast<std::size_t>(owner)];
      if (owner == exchange_.Rank())
      {
        places.push_back(i);
      }
    };
    for (std::uint32_t i = 0; i < owners.size(); ++i)
    {
      if (owners[i] >= 0)
      {
        add(i, owners[i]);
      }
    }
    std::size_t dealt = 0;
    int owner = 0;
    for (const std::uint32_t i : MortonOrder(field.means))
    {
      if (owners[i] >= 0)
      {
        continue;
      }
      if (dealt++ % kBlock == 0)
      {
        owner = static_cast<int>(std::min_element(counts.begin(), counts.end()) - counts.begin());
      }
      add(i, owner);
    }
    std::sort(places.begin(), places.end());
    return places;
  }

  Exchange& exchange_;
  std::unique_ptr<Engine> own_;
  Places places_;         // of this process's Gaussians in the whole field, ascending
  std::size_t size_ = 0;  // of the whole field
  TransferFunction transfer_;
  Beam beam_;
};

}  // namespace

std::unique_ptr<Engine> CreatePartEngine(const std::string& name, Exchange& exchange)
{
  return std::make_unique<PartEngine>(name == "auto" ? "cpu" : name, exchange);
}

}  // namespace bigus
