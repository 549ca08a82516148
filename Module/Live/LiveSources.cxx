// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Live/LiveSources.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <utility>

#include "Command.h"
#include "Core/Model/Error.h"
#include "Exit.h"
#include "Files.h"
#include "IO/FileError.h"
#include "IO/Formats/PngFile.h"
#include "IO/Formats/PoseCsv.h"
#include "IO/Poses.h"
#include "IO/Text.h"
#include "Live/IgtConnection.h"

namespace bigus::command
{

namespace
{

using Clock = std::chrono::steady_clock;

/// Newest looks whose times are kept.
constexpr std::size_t kMostLooks = 100000;

/// Seconds between picture and TRANSFORM that belong together.
constexpr double kTogether = 0.05;

/// What is heard of a server before one of its devices is followed: others that send as often are heard by then. A session
/// takes as many frames at once.
constexpr std::size_t kHeldPictures = 16;
constexpr double kListening = 1;  // s

/// Devices of pictures that are told apart.
constexpr std::size_t kMostDevices = 16;

/// Seconds between two attempts to reach a server that went away.
constexpr double kBetweenAttempts = 0.5;

/// Seconds that one attempt may take.
constexpr double kAttempt = 5;

/// Seconds between two looks for new rows of a table: frames of 50 a second wait one of their periods at most.
constexpr double kBetweenRows = 0.02;

/// Seconds that a row waits for its picture to be whole. Who writes the picture first needs none.
constexpr double kPictureLate = 2;

double Quantile(std::vector<double> values, double q)
{
  if (values.empty())
  {
    return std::nan("");
  }
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(q * static_cast<double>(values.size() - 1))];
}

/// The pose of a frame by its fields, as of a sequence that has no other frame. Empty where no transforms lead from one
/// coordinate frame to the other, and none are taken from a configuration. Throws Error when they do and are not usable.
std::optional<Eigen::Matrix4d> PoseByFields(const PoseChain& chain, const std::string& name, const Fields& fields,
                                            int width, int height)
{
  SequenceFile sequence;
  sequence.fileName = name;
  sequence.width = width;
  sequence.height = height;
  sequence.numberOfFrames = 1;
  sequence.frames = {fields};
  PoseTable table;
  try
  {
    ResolvePoses(sequence, PoseOptionsOf(chain), table);
  }
  catch (const FileError&)
  {
    if (!table.chain.empty() || !chain.config.empty())
    {
      throw;
    }
    return std::nullopt;
  }
  table.RequireFrames(name);
  return table.frames[0].imageToReference;
}

/// A frame's size and pixels. Throws FileError when the file is not there or not whole, and Error where the session has no
/// room for it.
LiveFrame ReadPicture(const std::string& path, const LiveSession& session)
{
  const PngHeader header = ReadPngHeader(path);
  Require(header.elementType == ElementType::UInt8, path, ": has 16 bits a pixel. Pictures that are followed have 8.");
  session.RequireRoom(header.width, header.height);
  LiveFrame frame;
  frame.width = header.width;
  frame.height = header.height;
  frame.pixels.resize(static_cast<std::size_t>(header.width) * static_cast<std::size_t>(header.height));
  ReadPng(path, header, frame.pixels.data());
  return frame;
}

/// Frames on their way to a session.
class Follower
{
public:
  Follower(const LiveSource& source, LiveSession& session, Looker& looker, SliceServer& slices, LiveStatus& status,
           Console& console)
      : source_(source), session_(session), looker_(looker), slices_(slices), status_(status), console_(console)
  {
  }

  const LiveEvents& Events() const { return events_; }

protected:
  void HandOver(LiveFrame frame)
  {
    looker_.MoveProbe(frame.imageToReference, frame.width, frame.height);
    session_.Add(std::move(frame));
    ++frames_;
    lastFrame_ = Clock::now();
    if (lastFrame_ >= nextLook_)
    {
      looker_.LookAtProbe();
      nextLook_ = Clock::now() + std::chrono::milliseconds(static_cast<int>(1000 * kLook));
    }
    ShowProgress();
  }

  void Refuse(const std::string& why)
  {
    ++events_.refused;
    if (why != events_.lastRefusal)  // once, not for every frame
    {
      console_.Note("bigus: " + why);
      events_.lastRefusal = why;
    }
  }

  /// Whether no frame came for so long, of those that came at all.
  bool IsSilentFor(double seconds) const { return frames_ > 0 && SecondsSince(lastFrame_) >= seconds; }

  /// Silence counts from now, because until now nothing could come.
  void BeginSilence() { lastFrame_ = Clock::now(); }

  void ShowProgress()
  {
    console_.Progress("Following", 0, std::to_string(session_.GetState().gaussians) + " Gaussians");
  }

  const LiveSource& source_;
  LiveSession& session_;
  Looker& looker_;
  SliceServer& slices_;
  LiveStatus& status_;
  Console& console_;
  LiveEvents events_;
  const Clock::time_point begin_ = Clock::now();

private:
  std::size_t frames_ = 0;
  Clock::time_point lastFrame_ = begin_, nextLook_ = begin_;
};

class ServerFollower : public Follower
{
public:
  using Follower::Follower;

  void Follow()
  {
    const IgtAddress address = IgtAddress::Parse(source_.sequence.path);
    auto connection = std::make_unique<IgtConnection>(address, kAttempt);
    console_.Note("Connected to " + source_.sequence.path + ". Following until frames came and none comes for " +
                  FormatNumber(source_.pause, 1) + " s, or Ctrl-C.");
    while (FollowConnection(*connection))
    {
      connection.reset();
      connection = Reconnect(address);
      if (!connection)
      {
        break;
      }
      ++events_.reconnects;
      isNew_ = true;
      BeginSilence();
      console_.Note("Connected to " + source_.sequence.path + " again. Following goes on.");
    }
    Require(device_ || heard_.empty(), source_.sequence.path, ": no picture came of the device '", source_.device,
            "' (--device), but of ", HeardDevices(), ". Name one of these.");
  }

private:
  /// Until the probe is lifted or the program interrupted; true when the connection was lost before.
  bool FollowConnection(IgtConnection& connection)
  {
    const bool isLost = FollowMessages(connection);
    ChooseDevice(true);
    return isLost;
  }

  bool FollowMessages(IgtConnection& connection)
  {
    IgtConnection::Message message;
    while (!IsInterrupted() && !IsSilentFor(source_.pause))
    {
      status_.Tell("following", events_);
      IgtConnection::Event event;
      try
      {
        slices_.Wait(connection.Socket(), kLook);
        event = connection.Receive(0, message);
      }
      catch (const Error& error)  // where the next message begins is not known
      {
        Refuse(std::string(error.what()) + " What came so far is kept.");
        return true;
      }
      if (event == IgtConnection::Event::Closed)
      {
        console_.Note("The server closed the connection. What came so far is kept.");
        return true;
      }
      if (event == IgtConnection::Event::Message)
      {
        Take(connection, message);
      }
      ChooseDevice(held_.size() >= kHeldPictures || (!held_.empty() && SecondsSince(listensSince_) > kListening));
    }
    return false;
  }

  /// A server that is there again, or null. No frame comes meanwhile, and the session goes on with those it has.
  std::unique_ptr<IgtConnection> Reconnect(const IgtAddress& address)
  {
    // Since the last frame, so that a server that only takes connections and drops them is not waited for without end.
    if (!isWaiting_ || frameSinceWaiting_)
    {
      waitingSince_ = Clock::now();
      isWaiting_ = true;
      frameSinceWaiting_ = false;
    }
    if (source_.reconnect > 0 && SecondsSince(waitingSince_) < source_.reconnect)
    {
      console_.Note("Waiting " + FormatNumber(source_.reconnect, 1) + " s for " + source_.sequence.path + ".");
    }
    while (!IsInterrupted() && SecondsSince(waitingSince_) < source_.reconnect)
    {
      for (double slept = 0; slept < kBetweenAttempts && !IsInterrupted(); slept += kLook)
      {
        status_.Tell("waiting", events_);
        slices_.Wait(-1, kLook);
      }
      try
      {
        return std::make_unique<IgtConnection>(address, std::min(kAttempt, source_.reconnect));
      }
      catch (const Error&)  // not yet
      {
      }
    }
    return nullptr;
  }

  void Take(IgtConnection& connection, const IgtConnection::Message& message)
  {
    const IgtHeader& header = message.header;
    const bool isPicture = header.type == "IMAGE" || header.type == "TRACKEDFRAME";
    try
    {
      if (isPicture && !source_.device.empty() && header.device != source_.device)
      {
        PassOver(header.device);
      }
      else if (header.type == "IMAGE")
      {
        TakeFrame(ParseIgtImage(header, message.body), header);
      }
      else if (header.type == "TRACKEDFRAME")
      {
        TakeTrackedFrame(ParseIgtTrackedFrame(header, message.body), header);
      }
      else if (header.type == "TRANSFORM" && header.device == source_.transform)
      {
        pose_ = ParseIgtTransform(header, message.body);
        poseTime_ = header.timestamp;
      }
      else if (header.type == "TRANSFORM" && header.device == source_.plane)
      {
        connection.Send(
            SliceMessage(looker_, ParseIgtTransform(header, message.body), header.timestamp, source_.sliceSize));
      }
    }
    catch (const Error& error)
    {
      Refuse(error.what());
    }
  }

  void TakeTrackedFrame(IgtTrackedFrame frame, const IgtHeader& header)
  {
    if (source_.transform.empty())
    {
      const std::string name = "TRACKEDFRAME of '" + header.device + "'";
      const PoseChain& chain = source_.sequence.chain;
      if (const auto pose = PoseByFields(chain, name, frame.fields, frame.image.width, frame.image.height))
      {
        frame.image.imageToWorld = *pose;
      }
      else if (!frame.hasPose)
      {
        throw Error(name + ": no transforms of it lead from " + chain.from + " to " + chain.to +
                    ", and none is embedded. Give the configuration of Plus that has the others (--config), other "
                    "coordinate frames (--image-to), or set EmbeddedTransformToFrame in Plus.");
      }
    }
    TakeFrame(std::move(frame.image), header);
  }

  /// Says once of each device that its pictures are not followed.
  void PassOver(const std::string& device)
  {
    if (std::find(heard_.begin(), heard_.end(), device) == heard_.end() && heard_.size() < kMostDevices)
    {
      heard_.push_back(device);
      console_.Note("bigus: pictures of '" + device + "' are not followed. --device names what is.");
    }
  }

  /// Whether pictures of a device are those that the transform is about: in Plus, Image_Reference goes with ImageToReference.
  bool IsOfTransform(const std::string& device) const
  {
    const std::string from = source_.transform.substr(0, source_.transform.find("To", 1));
    return !source_.transform.empty() && (device == from || device.rfind(from + "_", 0) == 0);
  }

  std::string HeardDevices() const
  {
    std::string names;
    for (const std::string& device : heard_)
    {
      names += (names.empty() ? "'" : ", '") + device + "'";
    }
    return names;
  }

  /// Hands over what was held, where it is known whose pictures are followed. `isDue`: nobody else is waited for. Throws
  /// Error where several devices send pictures and nothing says which one counts.
  void ChooseDevice(bool isDue)
  {
    if (!isDue || held_.empty() || device_)
    {
      return;
    }
    Require(heard_.size() <= 1, source_.sequence.path, ": ", heard_.size(), " devices send pictures, ", HeardDevices(),
            ". Name the one to follow (--device).");
    device_ = heard_.front();
    for (Held& held : std::exchange(held_, {}))
    {
      Deliver(std::move(held.image), held.header, held.arrival);
    }
  }

  void TakeFrame(IgtImage image, const IgtHeader& header)
  {
    session_.RequireRoom(image.width, image.height);
    if (device_ && header.device != *device_)
    {
      PassOver(header.device);
      return;
    }
    if (!source_.transform.empty())
    {
      if (!pose_ || std::abs(poseTime_ - header.timestamp) > kTogether)
      {
        throw Error("a picture came without a TRANSFORM of '" + source_.transform + "' at its time.");
      }
      image.imageToWorld = *pose_;
    }
    const double now = SecondsSince(begin_);
    if (!device_ && (!source_.device.empty() || IsOfTransform(header.device)))
    {
      device_ = header.device;
      held_.clear();
    }
    if (device_)
    {
      Deliver(std::move(image), header, now);
      return;
    }
    listensSince_ = held_.empty() ? Clock::now() : listensSince_;
    held_.push_back({std::move(image), header, now});
    if (std::find(heard_.begin(), heard_.end(), header.device) == heard_.end() && heard_.size() < kMostDevices)
    {
      heard_.push_back(header.device);
    }
  }

  /// `now`: s since the beginning, when it came.
  void Deliver(IgtImage image, const IgtHeader& header, double now)
  {
    LiveFrame frame;
    frame.width = image.width;
    frame.height = image.height;
    frame.pixels = std::move(image.pixels);
    frame.imageToReference = image.imageToWorld;
    frame.timestamp = header.timestamp > 0 ? header.timestamp + shift_ : now;
    if (isNew_ && lastTime_ && header.timestamp > 0 && frame.timestamp <= *lastTime_)
    {
      // The server began its clock anew. Its frames come after those before by as much as was waited.
      shift_ += *lastTime_ + (now - lastArrival_) - frame.timestamp;
      frame.timestamp = header.timestamp + shift_;
    }
    isNew_ = false;
    lastTime_ = lastTime_ ? std::max(*lastTime_, frame.timestamp) : frame.timestamp;
    lastArrival_ = now;
    frameSinceWaiting_ = true;
    HandOver(std::move(frame));
  }

  /// A picture, and when it came.
  struct Held
  {
    IgtImage image;
    IgtHeader header;
    double arrival;
  };

  std::optional<std::string> device_;  // whose pictures are followed
  std::vector<Held> held_;             // until that is known
  std::vector<std::string> heard_;     // devices of pictures, but for one that is followed from its first
  Clock::time_point listensSince_;
  std::optional<Eigen::Matrix4d> pose_;  // what TRANSFORM said last
  double poseTime_ = 0;
  std::optional<double> lastTime_;  // s, of the latest frame
  double lastArrival_ = 0;          // s since the beginning
  double shift_ = 0;                // s, from the server's clock to that of the first connection
  bool isNew_ = false;              // no frame came over this connection yet
  bool isWaiting_ = false, frameSinceWaiting_ = false;
  Clock::time_point waitingSince_;
};

/// Whole lines of a file that grows.
class GrowingFile
{
public:
  explicit GrowingFile(const std::string& path) : path_(path), stream_(path, std::ios::binary)
  {
    Require(!stream_.fail(), path, ": the file cannot be opened.");
  }

  /// False when no whole line is there yet. Throws Error when the file became shorter, or a line is too long.
  bool Next(std::string& line)
  {
    std::size_t end = rest_.find('\n');
    if (end == std::string::npos && Fill())
    {
      end = rest_.find('\n');
    }
    if (end == std::string::npos)
    {
      Require(rest_.size() <= kLongestLine, path_, ": a line is longer than ", kLongestLine, " bytes.");
      return false;
    }
    line = rest_.substr(0, end);
    rest_.erase(0, end + 1);
    if (!line.empty() && line.back() == '\r')
    {
      line.pop_back();
    }
    return true;
  }

private:
  static constexpr std::size_t kLongestLine = std::size_t(1) << 16;

  bool Fill()
  {
    std::error_code failure;
    const std::uintmax_t size = std::filesystem::file_size(path_, failure);
    Require(!failure && size >= read_, path_, ": the file became shorter or went away. What came so far is kept.");
    if (size == read_)
    {
      return false;
    }
    char bytes[4096];
    stream_.clear();
    stream_.seekg(static_cast<std::streamoff>(read_));
    stream_.read(bytes, sizeof(bytes));
    const auto count = static_cast<std::size_t>(stream_.gcount());
    rest_.append(bytes, count);
    read_ += count;
    return count > 0;
  }

  std::string path_;
  std::ifstream stream_;
  std::string rest_;  // read, and not yet given
  std::uintmax_t read_ = 0;
};

class TableFollower : public Follower
{
public:
  using Follower::Follower;

  void Follow()
  {
    const std::string& path = source_.sequence.path;
    std::error_code ignored;
    if (!std::filesystem::is_regular_file(path, ignored))  // a pipe would be waited for, a device read without end
    {
      throw Error(path + ": is not a file. --follow takes a CSV of poses while it is written.");
    }
    GrowingFile file(path);
    console_.Note("Following " + path + " until rows came and none comes for " + FormatNumber(source_.pause, 1) +
                  " s, or Ctrl-C.");
    std::optional<PoseCsv> table;
    std::string line;
    while (!IsInterrupted() && !IsSilentFor(source_.pause))
    {
      status_.Tell("following", events_);
      try
      {
        if (!file.Next(line))
        {
          slices_.Wait(-1, kBetweenRows);
          continue;
        }
      }
      catch (const Error& error)
      {
        if (rows_ == 0)
        {
          throw;
        }
        Refuse(error.what());
        return;
      }
      if (!table)
      {
        table.emplace(path, line);
        Require(table->HasColumn("image"), path,
                ": has no column image. A table that is followed names the PNG of every row.");
        continue;
      }
      if (Trimmed(line).empty() || PoseCsv::IsComment(line) || (rows_ == 0 && table->HoldsUnits(line)))
      {
        continue;
      }
      try
      {
        TakeRow(table->Parse(line, rows_++));
      }
      catch (const Error& error)
      {
        Refuse(error.what());
      }
      BeginSilence();  // a row came, even if its picture did not
    }
  }

private:
  void TakeRow(const PoseCsv::Row& row)
  {
    const std::string& path = source_.sequence.path;
    const std::string name = path + ": row " + std::to_string(rows_ - 1);
    const auto pose = PoseByFields(source_.sequence.chain, name, row.fields, 1, 1);
    Require(pose.has_value(), name, ": its pose leads from Image to Reference, not from ", source_.sequence.chain.from,
            " to ", source_.sequence.chain.to, ".");
    LiveFrame frame = Picture(row, name);
    frame.imageToReference = *pose;
    frame.timestamp = SecondsSince(begin_);
    if (const auto time = row.fields.find("Timestamp");
        time != row.fields.end() && !ParseNumber(time->second, frame.timestamp))
    {
      throw Error(name + ": its timestamp is " + Quoted(time->second) + "; seconds are expected.");
    }
    HandOver(std::move(frame));
  }

  /// Of a row's picture, which may come a little later than the row. Throws Error when it does not come.
  LiveFrame Picture(const PoseCsv::Row& row, const std::string& name)
  {
    const std::string& path = source_.sequence.path;
    const std::string folder = source_.sequence.imageFolder.empty() ? FolderOf(path) : source_.sequence.imageFolder;
    const Clock::time_point since = Clock::now();
    while (true)
    {
      try
      {
        return ReadPicture(CompanionFile(path, folder, row.image), session_);
      }
      catch (const FileError& error)  // it is not there, or not whole
      {
        if (SecondsSince(since) > kPictureLate || IsInterrupted())
        {
          throw Error(name + ": " + error.what());
        }
      }
      slices_.Wait(-1, kBetweenRows);
    }
  }

  std::size_t rows_ = 0;
};

}  // namespace

const std::vector<float>& Looker::Look(const Eigen::Matrix4d& imageToReference, int width, int height)
{
  return Render(SlicePlane::FromImageToReference(imageToReference, width, height), false);
}

const std::vector<float>& Looker::LookWithCoverage(const Eigen::Matrix4d& imageToReference, int width, int height)
{
  return Render(SlicePlane::FromImageToReference(imageToReference, width, height), true);
}

void Looker::MoveProbe(const Eigen::Matrix4d& imageToReference, int width, int height)
{
  probe_ = SlicePlane::FromImageToReference(imageToReference, width, height);
}

void Looker::LookAtProbe()
{
  Render(*probe_, false);
}

const std::vector<float>& Looker::Render(const SlicePlane& plane, bool withCoverage)
{
  const std::size_t pixels = plane.NumberOfPixels();
  image_.resize(withCoverage ? 2 * pixels : pixels);
  const Clock::time_point start = Clock::now();
  session_.Render(plane, ViewOutput::Intensity, image_.data(), withCoverage ? image_.data() + pixels : nullptr);
  if (latencies_.size() == kMostLooks)
  {
    latencies_.erase(latencies_.begin(), latencies_.begin() + kMostLooks / 2);
  }
  latencies_.push_back(1000 * SecondsSince(start));
  return image_;
}

std::vector<float> Looker::Gaussians(std::size_t most) const
{
  const GaussianField field = session_.Field();
  const std::size_t step = std::max<std::size_t>(1, (field.Size() + most - 1) / most);
  std::vector<float> numbers;
  for (std::size_t k = 0; k < field.Size(); k += step)
  {
    const Eigen::Vector3d &mean = field.means[k], &scale = field.scales[k];
    for (const double number : {mean.x(), mean.y(), mean.z(), field.reflectivities[k], scale.x(), scale.y(), scale.z()})
    {
      numbers.push_back(static_cast<float>(number));
    }
  }
  return numbers;
}

Json Looker::ProbeJson() const
{
  if (!probe_)
  {
    return nullptr;
  }
  const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> matrix = probe_->ImageToReference();
  return {{"plane", std::vector<double>(matrix.data(), matrix.data() + matrix.size())},
          {"width", probe_->width},
          {"height", probe_->height}};
}

Json Looker::ToJson() const
{
  return {{"slices", latencies_.size()},
          {"median_ms", Quantile(latencies_, 0.5)},
          {"q95_ms", Quantile(latencies_, 0.95)},
          {"largest_ms", Quantile(latencies_, 1)}};
}

std::string Looker::Text() const
{
  return FormatNumber(Quantile(latencies_, 0.5), 1) + " ms (median), " + FormatNumber(Quantile(latencies_, 0.95), 1) +
         " ms (95 % below), " + FormatNumber(Quantile(latencies_, 1), 1) + " ms (longest)";
}

LiveStatus::LiveStatus(std::string path, const LiveSession& session, const Looker& looker, Console& console)
    : path_(std::move(path)), session_(session), looker_(looker), console_(console)
{
}

void LiveStatus::Tell(const std::string& phase, const LiveEvents& events, double fraction)
{
  constexpr double kBetweenWrites = 1;  // s
  const bool isDue = phase != phase_ || SecondsSince(written_) >= kBetweenWrites;
  phase_ = phase;
  events_ = events;
  fraction_ = fraction;
  if (path_.empty() || !isDue)
  {
    return;
  }
  Json status = Now();
  status.erase("probe");
  status["latency"] = looker_.ToJson();
  try
  {
    WriteAtomically(path_, [&status](std::ostream& file) { file << status.dump(2) << '\n'; });
  }
  catch (const Error& error)
  {
    if (!hasFailed_)
    {
      console_.Note(std::string("bigus: warning: ") + error.what() + " Following goes on without it.");
      hasFailed_ = true;
    }
  }
  written_ = Clock::now();
}

Json LiveStatus::Now() const
{
  const LiveSession::State state = session_.GetState();
  return {{"phase", phase_},
          {"fraction", fraction_ < 0 ? Json(nullptr) : Json(fraction_)},
          {"uptime_seconds", SecondsSince(begin_)},
          {"frames", state.frames},
          {"waiting", state.waiting},
          {"passed_over", state.passedOver},
          {"dropped", state.dropped},
          {"refused", state.refused + events_.refused},
          {"reconnects", events_.reconnects},
          {"steps", state.steps},
          {"gaussians", state.gaussians},
          {"probe", looker_.ProbeJson()}};
}

LiveEvents FollowServer(const LiveSource& source, LiveSession& session, Looker& looker, SliceServer& slices,
                        LiveStatus& status, Console& console)
{
  ServerFollower follower(source, session, looker, slices, status, console);
  follower.Follow();
  return follower.Events();
}

LiveEvents FollowTable(const LiveSource& source, LiveSession& session, Looker& looker, SliceServer& slices,
                       LiveStatus& status, Console& console)
{
  TableFollower follower(source, session, looker, slices, status, console);
  follower.Follow();
  return follower.Events();
}

}  // namespace bigus::command
