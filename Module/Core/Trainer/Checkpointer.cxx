// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Trainer/Checkpointer.h"

#include <algorithm>

#include "Core/Engine/Exchange.h"
#include "Core/Engine/FieldState.h"
#include "Core/Model/Error.h"
#include "Core/Model/Sequences.h"
#include "Core/Numerics/Checksum.h"
#include "Core/Numerics/StateBytes.h"
#include "Core/Training/OptionList.h"

namespace bigus
{
namespace
{

constexpr char kMagic[8] = {'B', 'I', 'G', 'U', 'S', 'C', 'K', 'P'};

/// Another number for every change of what follows the header.
constexpr std::uint32_t kFormat = 10;

/// Tells machines with another order of bytes.
constexpr std::uint32_t kByteOrder = 0x01020304;

constexpr std::size_t kHeaderBytes = sizeof(kMagic) + 2 * sizeof(std::uint32_t) + 2 * sizeof(std::uint64_t);

/// s, longer than any training.
constexpr double kLongest = 1e10;

/// Characters of a text from a state that a message quotes.
constexpr std::size_t kQuoted = 60;

constexpr const char* kBegin = " Begin anew, without a checkpoint.";

/// Fills the room for a header in front of a body.
void SetHeader(std::string& bytes)
{
  const std::string_view body = std::string_view(bytes).substr(kHeaderBytes);
  StateWriter header;
  header.Numbers(kMagic, sizeof(kMagic));
  header.Number(kFormat);
  header.Number(kByteOrder);
  header.Number<std::uint64_t>(body.size());
  header.Number(Checksum().Add(body.data(), body.size()).Value());
  bytes.replace(0, kHeaderBytes, header.Take());
}

/// What follows the header. Throws Error unless the bytes are whole.
std::string_view BodyOf(std::string_view bytes)
{
  Require(bytes.substr(0, sizeof(kMagic)) == std::string_view(kMagic, sizeof(kMagic)),
          "This is no checkpoint of a training.", kBegin);
  Require(bytes.size() >= kHeaderBytes, "The checkpoint ends after ", bytes.size(), " bytes: it was cut off.", kBegin);
  StateReader header(bytes.substr(sizeof(kMagic), kHeaderBytes - sizeof(kMagic)));
  const auto format = header.Number<std::uint32_t>(), order = header.Number<std::uint32_t>();
  const auto size = header.Number<std::uint64_t>(), checksum = header.Number<std::uint64_t>();
  const std::string_view body = bytes.substr(kHeaderBytes);
  Require(format == kFormat && order == kByteOrder, "The checkpoint has format ", format,
          order != kByteOrder ? ", of another machine" : "", "; this program reads format ", kFormat, ".", kBegin);
  Require(body.size() == size, "The checkpoint holds ", body.size(), " bytes and says ", size,
          body.size() < size ? ": it was cut off." : ".", kBegin);
  Require(Checksum().Add(body.data(), body.size()).Value() == checksum,
          "The checkpoint was damaged: its checksum is wrong.", kBegin);
  return body;
}

void SaveTexts(const NamedTexts& texts, StateWriter& to)
{
  to.Number<std::uint64_t>(texts.size());
  for (const auto& [name, text] : texts)
  {
    to.Text(name);
    to.Text(text);
  }
}

/// Of printable characters, because they are printed.
std::string LoadText(StateReader& from)
{
  const std::string_view text = from.Text();
  StateReader::Require(std::none_of(text.begin(), text.end(),
                                    [](unsigned char character) { return character < ' ' || character == 0x7f; }),
                       "a text of other than printable characters");
  return std::string(text);
}

NamedTexts LoadTexts(StateReader& from)
{
  NamedTexts texts(from.Count(2 * sizeof(std::uint64_t)));
  for (auto& [name, text] : texts)
  {
    name = LoadText(from);
    text = LoadText(from);
  }
  return texts;
}

void SaveSettlement(const Settlement& settlement, StateWriter& to)
{
  SaveTexts(settlement.options, to);
  to.Number<std::uint64_t>(settlement.decisions.size());
  for (const Decision& decision : settlement.decisions)
  {
    to.Text(decision.what);
    to.Text(decision.choice);
    to.Text(decision.evidence);
    to.Number(decision.seconds);
  }
  SaveVectors(settlement.imageToReference, to);
}

Settlement LoadSettlement(StateReader& from)
{
  Settlement settlement;
  settlement.options = LoadTexts(from);
  settlement.decisions.resize(from.Count(4 * sizeof(std::uint64_t)));
  for (Decision& decision : settlement.decisions)
  {
    decision.what = LoadText(from);
    decision.choice = LoadText(from);
    decision.evidence = LoadText(from);
    decision.seconds = from.NumberIn(0.0, kLongest);
  }
  settlement.imageToReference = LoadVectors<Eigen::Matrix4d>(from);
  return settlement;
}

/// Which engine computes, without the number of threads, which changes no bit.
std::string EngineOf(const std::string& name)
{
  std::string device = Engine::Create(name)->Device();
  const std::size_t threads = device.rfind(" threads)"), comma = device.rfind(", ", threads);
  if (threads != std::string::npos && comma != std::string::npos)
  {
    device.replace(comma, std::string::npos, ")");
  }
  return device;
}

}  // namespace

NamedTexts IdentityOf(const Sweep& sweep, const TrainerOptions& options, const GaussianField* start)
{
  const std::size_t frames = sweep.imageToReference.size();
  const std::size_t pixelBytes = sweep.pixelType == Sweep::PixelType::UInt8 ? 1 : sizeof(float);
  Checksum pixels, poses, mask, field;
  pixels.Add(sweep.pixels.get(), pixelBytes * frames * sweep.PixelsPerFrame());
  for (const Eigen::Matrix4d& pose : sweep.imageToReference)
  {
    poses.Add(pose.data(), sizeof(double) * pose.size());
  }
  poses.Add(sweep.timestamps.data(), sizeof(double) * sweep.timestamps.size());
  if (sweep.mask)
  {
    mask.Add(sweep.mask->data(), sweep.mask->size());
  }
  if (start)
  {
    StateWriter bytes;
    SaveField(*start, bytes);
    const std::string text = bytes.Take();
    field.Add(text.data(), text.size());
  }
  std::string parts;
  const std::vector<Sequence> sequences = SequencesOf(sweep);
  for (std::size_t k = 0; k < sequences.size() && sequences.size() > 1; ++k)
  {
    parts += (k == 0 ? ", in sequences of " : ", ") + std::to_string(sequences[k].sweep.NumberOfFrames());
  }
  NamedTexts identity = {{"version", BIGUS_VERSION},
                         {"engine", EngineOf(options.engine)},
                         {"sequence", std::to_string(frames) + " frames of " + std::to_string(sweep.width) + " x " +
                                          std::to_string(sweep.height) + " pixels" + parts},
                         {"checksum of the pixels", pixels.Text()},
                         {"checksum of the poses and times", poses.Text()},
                         {"checksum of the mask", sweep.mask ? mask.Text() : "none"},
                         {"checksum of the field to continue from", start ? field.Text() : "none"}};
  for (const OptionText& option : ListOptions(options))
  {
    const std::string name = option.info.name;
    if (name != "TimeLimit" && name != "Engine")
    {
      identity.emplace_back(SpellOption(name), option.value);
    }
  }
  return identity;
}

Checkpointer::Checkpointer(const Checkpoints& checkpoints, NamedTexts identity, Exchange& exchange)
    : checkpoints_(checkpoints),
      exchange_(exchange),
      isKept_(exchange.OfFirst(checkpoints.save ? 1 : 0) > 0),
      identity_(std::move(identity))
{
  identity_.emplace_back("processes", std::to_string(exchange.Size()));
  const std::string resume = exchange.Gather(exchange.Rank() == 0 ? checkpoints.resume : std::string())[0];
  if (!resume.empty())
  {
    Load(BodyOf(resume));
  }
}

const TrialScores* Checkpointer::FindTrial(const std::string& name) const
{
  const auto found = trials_.find(name);
  return found == trials_.end() ? nullptr : &found->second;
}

void Checkpointer::NoteTrial(const std::string& name, const TrialScores& scores)
{
  trials_[name] = scores;
  trial_.clear();
  trialState_.clear();
  isSaved_ = false;
}

void Checkpointer::Settle(Settlement settlement, bool keepsTraining)
{
  settled_ = std::move(settlement);
  trials_.clear();
  trial_.clear();
  trialState_.clear();
  if (!keepsTraining)
  {
    training_.clear();
  }
  isSaved_ = false;
}

std::string Checkpointer::TakeTraining()
{
  return settled_ ? std::exchange(training_, {}) : training_;  // what saves a trial saves it, too
}

std::string Checkpointer::TakeTrial(const std::string& name)
{
  return name == trial_ ? std::exchange(trialState_, {}) : std::string();
}

Keeping Checkpointer::KeepIn(std::function<void(std::string)> take)
{
  if (!isKept_)
  {
    return {};
  }
  return {[this] { return IsDue(); },
          [this, take = std::move(take)](const auto& write)
          {
            StateWriter to;
            write(to);
            take(to.Take());
            Save();
            if (settled_)
            {
              training_.clear();  // the next one comes with its own
            }
          }};
}

Keeping Checkpointer::KeepingOfTraining()
{
  return KeepIn([this](std::string state) { training_ = std::move(state); });
}

Keeping Checkpointer::KeepingOfTrial(const std::string& name)
{
  return KeepIn(
      [this, name](std::string state)
      {
        trial_ = name;
        trialState_ = std::move(state);
      });
}

void Checkpointer::Close()
{
  if (!isSaved_)
  {
    Save();
  }
  isClosed_ = true;
}

bool Checkpointer::IsDue()
{
  if (!isKept_ || isClosed_)
  {
    return false;
  }
  const bool isDue = watch_.Seconds() - saved_ >= checkpoints_.interval;
  return exchange_.OfFirst(isDue ? 1 : 0) > 0;
}

void Checkpointer::Save()
{
  if (!isKept_ || isClosed_)
  {
    return;
  }
  if (exchange_.Rank() == 0)
  {
    Write();
  }
  exchange_.Any(false);  // all hear of it when the first cannot write
  saved_ = watch_.Seconds();
  isSaved_ = true;
}

void Checkpointer::Write()
{
  StateWriter to;
  constexpr char kRoom[kHeaderBytes] = {};
  to.Numbers(kRoom, kHeaderBytes);
  to.Number(seconds_ + watch_.Seconds());
  SaveTexts(identity_, to);
  to.Number<std::uint64_t>(trials_.size());
  for (const auto& [name, scores] : trials_)
  {
    to.Text(name);
    to.Array(scores.frames);
    to.Array(scores.across);
    to.Array(scores.seen);
  }
  to.Flag(settled_.has_value());
  if (settled_)
  {
    SaveSettlement(*settled_, to);
  }
  to.Text(training_);
  to.Text(trial_);
  to.Text(trialState_);
  std::string bytes = to.Take();
  SetHeader(bytes);
  checkpoints_.save(bytes);
}

void Checkpointer::Load(std::string_view bytes)
{
  StateReader from(bytes);
  seconds_ = from.NumberIn(0.0, kLongest);
  RequireSameTraining(LoadTexts(from));
  for (std::size_t left = from.Count(4 * sizeof(std::uint64_t)); left > 0; --left)
  {
    const std::string name = LoadText(from);
    TrialScores& scores = trials_[name];
    scores.frames = from.Array<double>();
    scores.across = from.Array<double>();
    scores.seen = from.Array<double>();
  }
  if (from.Flag())
  {
    settled_ = LoadSettlement(from);
  }
  training_ = from.Text();
  trial_ = LoadText(from);
  trialState_ = from.Text();
  from.End();
}

void Checkpointer::RequireSameTraining(const NamedTexts& then) const
{
  std::string differences;
  for (const auto& [name, now] : identity_)
  {
    const auto found =
        std::find_if(then.begin(), then.end(), [&name = name](const auto& text) { return text.first == name; });
    const std::string was = found == then.end() ? "not known" : found->second;
    if (was != now)
    {
      differences += (differences.empty() ? "" : "; ") + name + " was " + was.substr(0, kQuoted) + " and is " +
                     now.substr(0, kQuoted);
    }
  }
  Require(differences.empty(), "The checkpoint is of another training: ", differences,
          ". Give the sequence and the options of then, or begin anew, without the checkpoint.");
}

}  // namespace bigus
