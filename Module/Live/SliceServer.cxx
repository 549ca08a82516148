// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Live/SliceServer.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <utility>

#include "Core/Model/Error.h"
#include "Exit.h"
#include "Live/LiveSources.h"

namespace bigus::command
{
namespace
{

using Clock = std::chrono::steady_clock;

constexpr std::size_t kMostClients = 16;

/// Bytes of a client's message: a TRANSFORM has 48, and what version 3 of the protocol adds.
constexpr std::size_t kLargestRequest = 4096;

/// Messages of one client that are looked at in one go, so that one that sends without end does not hold up the others.
constexpr int kMostAtOnce = 64;

/// Device of questions of JSON and of what answers them.
constexpr const char* kView = "BigusView";

/// Bounds of a view: those of a page in the browser.
constexpr int kLargestSide = 4096, kMostPixels = 2 * 1024 * 1024, kMostPoints = 60000;

/// A whole number of a question. Throws Error.
int WholeOf(const Json& question, const std::string& name, int largest)
{
  const auto found = question.find(name);
  Require(found != question.end() && found->is_number_integer() && *found >= 1 && *found <= largest, name,
          " is a whole number from 1 to ", largest, ".");
  return found->get<int>();
}

/// The matrix of a question, sound or not. Throws Error where there is none.
Eigen::Matrix4d PlaneOf(const Json& question)
{
  const Json& numbers = question["plane"];
  if (!numbers.is_array() || numbers.size() != 16 ||
      !std::all_of(numbers.begin(), numbers.end(), [](const Json& number) { return number.is_number(); }))
  {
    throw Error("plane is a list of 16 numbers, the matrix from pixels to mm by rows.");
  }
  Eigen::Matrix4d matrix;
  for (std::size_t k = 0; k < numbers.size(); ++k)
  {
    matrix(static_cast<int>(k) / 4, static_cast<int>(k) % 4) = numbers[k].get<double>();
  }
  return matrix;
}

/// The array that a question asks for, as a message; empty where it asks for none. Throws Error for what is no question.
std::vector<std::uint8_t> ArrayFor(const Json& question, double timestamp, Looker& looker)
{
  Require(question.is_object(), "a question is an object of JSON.");
  if (question.contains("points"))
  {
    const std::vector<float> points = looker.Gaussians(WholeOf(question, "points", kMostPoints));
    return PackIgtArray(kView, timestamp, {static_cast<int>(points.size()) / kNumbersOfGaussian, kNumbersOfGaussian},
                        points);
  }
  if (question.contains("plane"))
  {
    const int width = WholeOf(question, "width", kLargestSide), height = WholeOf(question, "height", kLargestSide);
    Require(width <= kMostPixels / height, "a slice has at most ", kMostPixels, " pixels.");
    return PackIgtArray(kView, timestamp, {2, height, width},
                        looker.LookWithCoverage(PlaneOf(question), width, height));
  }
  return {};
}

}  // namespace

std::vector<std::uint8_t> SliceMessage(Looker& looker, const Eigen::Matrix4d& imageToWorld, double timestamp,
                                       const std::vector<int>& size)
{
  IgtImage slice;
  slice.width = size[0];
  slice.height = size[1];
  slice.imageToWorld = imageToWorld;
  const std::vector<float>& picture = looker.Look(imageToWorld, slice.width, slice.height);
  slice.pixels.resize(picture.size());
  std::transform(picture.begin(), picture.end(), slice.pixels.begin(),
                 [](float value) { return static_cast<std::uint8_t>(std::lround(255 * value)); });
  return PackIgtImage("BigusSlice", timestamp, slice);
}

SliceServer::SliceServer(int port, std::string device, std::vector<int> size, Looker& looker, const LiveStatus& status)
    : device_(std::move(device)), size_(std::move(size)), looker_(looker), status_(status)
{
  if (port == 0)
  {
    return;
  }
  sockaddr_in here{};
  here.sin_family = AF_INET;
  here.sin_addr.s_addr = htonl(INADDR_LOOPBACK);  // the protocol asks nobody who he is
  here.sin_port = htons(static_cast<std::uint16_t>(port));
  listener_ = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  const int yes = 1;
  if (listener_ >= 0)
  {
    setsockopt(listener_, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
  }
  if (listener_ < 0 || bind(listener_, reinterpret_cast<const sockaddr*>(&here), sizeof(here)) != 0 ||
      listen(listener_, static_cast<int>(kMostClients)) != 0)
  {
    const int fault = errno;
    if (listener_ >= 0)
    {
      close(listener_);
    }
    throw Error("--listen " + std::to_string(port) + ": " + std::strerror(fault) + ". Choose another port.");
  }
}

SliceServer::~SliceServer()
{
  if (listener_ >= 0)
  {
    close(listener_);
  }
}

void SliceServer::Accept()
{
  const int socket = accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
  if (socket < 0)
  {
    return;
  }
  Client client;
  client.connection = std::make_unique<IgtConnection>(socket, kLargestRequest);
  if (clients_.size() < kMostClients)
  {
    clients_.push_back(std::move(client));
  }
}

/// Takes what a client sent. False when it left, or what it sends is no message.
bool SliceServer::Hear(Client& client) const
{
  IgtConnection::Message message;
  for (int count = 0; count < kMostAtOnce; ++count)
  {
    try
    {
      const IgtConnection::Event event = client.connection->Receive(0, message);
      if (event != IgtConnection::Event::Message)
      {
        return event != IgtConnection::Event::Closed;
      }
      if (message.header.type == "TRANSFORM" && (device_.empty() || message.header.device == device_))
      {
        client.question = {message.header.timestamp, ParseIgtTransform(message.header, message.body), ""};
      }
      else if (message.header.type == "STRING" && message.header.device == kView)
      {
        client.question = {message.header.timestamp, std::nullopt, ParseIgtString(message.header, message.body)};
      }
    }
    catch (const Error&)
    {
      return false;
    }
  }
  return true;
}

std::vector<std::uint8_t> SliceServer::Answer(const Question& question) const
{
  if (question.plane)
  {
    try
    {
      return SliceMessage(looker_, *question.plane, question.timestamp, size_);
    }
    catch (const Error&)  // a plane that is none has no slice
    {
      return {};
    }
  }
  Json state = status_.Now();
  std::vector<std::uint8_t> array;
  try
  {
    array = ArrayFor(Json::parse(question.text, nullptr, false), question.timestamp, looker_);
  }
  catch (const Error& error)
  {
    state = {{"error", error.what()}};
  }
  std::vector<std::uint8_t> answer = PackIgtString(kView, question.timestamp, state.dump());
  answer.insert(answer.end(), array.begin(), array.end());
  return answer;
}

/// One answer for whoever is next among those who wait.
void SliceServer::AnswerNext()
{
  for (std::size_t k = 0; k < clients_.size(); ++k)
  {
    Client& client = clients_[(next_ + k) % clients_.size()];
    if (!client.question)
    {
      continue;
    }
    next_ = (next_ + k + 1) % clients_.size();
    const Question question = *client.question;
    client.question.reset();
    client.connection->Send(Answer(question));
    return;
  }
}

void SliceServer::Wait(int socket, double seconds)
{
  const Clock::time_point end =
      Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
  while (true)
  {
    std::vector<pollfd> waits = {{socket, POLLIN, 0}, {listener_, POLLIN, 0}};  // -1 is passed over
    bool isAsked = false;
    for (const Client& client : clients_)
    {
      waits.push_back({client.connection->Socket(), POLLIN, 0});
      isAsked = isAsked || client.question;
    }
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(end - Clock::now()).count();
    poll(waits.data(), waits.size(), isAsked ? 0 : static_cast<int>(std::max<long>(left, 0)));
    for (std::size_t k = clients_.size(); k-- > 0;)
    {
      if (waits[2 + k].revents != 0 && !Hear(clients_[k]))
      {
        clients_.erase(clients_.begin() + static_cast<std::ptrdiff_t>(k));
      }
    }
    if (waits[1].revents != 0)
    {
      Accept();
    }
    AnswerNext();
    if (waits[0].revents != 0 || Clock::now() >= end || IsInterrupted())
    {
      return;
    }
  }
}

}  // namespace bigus::command
