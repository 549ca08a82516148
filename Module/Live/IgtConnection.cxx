// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Live/IgtConnection.h"

#include <netdb.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>

#include "Core/Model/Error.h"

namespace bigus::command
{
namespace
{

constexpr const char* kScheme = "igtl://";
constexpr const char* kUsualPort = "18944";

/// Bytes that are asked for at once, so that memory grows with what comes and not with what a header promises.
constexpr std::size_t kChunk = std::size_t(1) << 16;

/// Milliseconds that a message may take to be sent, once begun.
constexpr int kSending = 200;

/// Connects a socket that does not block, within so many milliseconds. What went wrong, as errno; 0: nothing.
int Connect(int socket, const addrinfo& to, int milliseconds)
{
  if (connect(socket, to.ai_addr, to.ai_addrlen) == 0)
  {
    return 0;
  }
  if (errno != EINPROGRESS)
  {
    return errno;
  }
  pollfd wait{socket, POLLOUT, 0};
  const int ready = poll(&wait, 1, milliseconds);
  if (ready <= 0)
  {
    return ready == 0 ? ETIMEDOUT : errno;  // the second after a signal, such as Ctrl-C
  }
  int fault = 0;
  socklen_t size = sizeof(fault);
  return getsockopt(socket, SOL_SOCKET, SO_ERROR, &fault, &size) == 0 ? fault : errno;
}

}  // namespace

bool IgtAddress::IsOne(const std::string& text)
{
  return text.rfind(kScheme, 0) == 0;
}

IgtAddress IgtAddress::Parse(const std::string& text)
{
  const std::string place = text.substr(std::strlen(kScheme));
  const std::size_t colon = place.rfind(':');
  const IgtAddress address{place.substr(0, colon), colon == std::string::npos ? kUsualPort : place.substr(colon + 1)};
  const bool isNumber =
      !address.port.empty() && address.port.size() <= 5 &&
      std::all_of(address.port.begin(), address.port.end(), [](char c) { return c >= '0' && c <= '9'; });
  Require(!address.host.empty() && isNumber && std::stoi(address.port) >= 1 && std::stoi(address.port) <= 65535, "'",
          text, "' is no address of an OpenIGTLink server. It looks like igtl://localhost:18944.");
  return address;
}

IgtConnection::IgtConnection(const IgtAddress& address, double seconds)
{
  addrinfo wanted{};
  wanted.ai_family = AF_UNSPEC;
  wanted.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  const int fault = getaddrinfo(address.host.c_str(), address.port.c_str(), &wanted, &found);
  Require(fault == 0, "igtl://", address.host, ":", address.port, ": ", gai_strerror(fault), ".");
  int reason = 0;
  for (const addrinfo* one = found; one && socket_ < 0; one = one->ai_next)
  {
    socket_ = socket(one->ai_family, one->ai_socktype | SOCK_CLOEXEC | SOCK_NONBLOCK, one->ai_protocol);
    reason = socket_ < 0 ? errno : Connect(socket_, *one, static_cast<int>(1000 * seconds));
    if (socket_ >= 0 && reason != 0)
    {
      close(socket_);
      socket_ = -1;
    }
  }
  freeaddrinfo(found);
  Require(socket_ >= 0, "igtl://", address.host, ":", address.port, ": ", std::strerror(reason),
          ". Start the OpenIGTLink server first, and look at its port.");
}

IgtConnection::~IgtConnection()
{
  if (socket_ >= 0)
  {
    close(socket_);
  }
}

/// Takes what has come until so many bytes of the message are there. False when more must come.
bool IgtConnection::Fill(std::size_t bytes)
{
  while (received_.size() < bytes)
  {
    const std::size_t before = received_.size();
    received_.resize(std::min(bytes, before + kChunk));
    const ssize_t count = recv(socket_, received_.data() + before, received_.size() - before, 0);
    received_.resize(before + static_cast<std::size_t>(std::max<ssize_t>(count, 0)));
    if (count == 0 || (count < 0 && errno != EAGAIN && errno != EWOULDBLOCK && errno != EINTR))
    {
      closed_ = true;
      return false;
    }
    if (count < 0)
    {
      return false;
    }
  }
  return true;
}

IgtConnection::Event IgtConnection::Receive(double seconds, Message& message)
{
  using Clock = std::chrono::steady_clock;
  const Clock::time_point end =
      Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
  while (true)
  {
    if (Fill(kIgtHeaderBytes))
    {
      message.header = ParseIgtHeader(received_.data());
      Require(message.header.bodyBytes <= largestBody_, "OpenIGTLink: a message of ", message.header.bodyBytes,
              " bytes is not expected.");
      if (Fill(kIgtHeaderBytes + message.header.bodyBytes))
      {
        message.body.assign(received_.begin() + kIgtHeaderBytes, received_.end());
        received_.clear();
        return Event::Message;
      }
    }
    if (closed_)
    {
      return Event::Closed;
    }
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(end - Clock::now()).count();
    if (left <= 0)
    {
      return Event::Silence;
    }
    pollfd wait{socket_, POLLIN, 0};
    poll(&wait, 1, static_cast<int>(std::min<long>(left, 1000)));
  }
}

bool IgtConnection::Send(const std::vector<std::uint8_t>& message)
{
  std::size_t sent = 0;
  while (sent < message.size() && !closed_)
  {
    const ssize_t count = send(socket_, message.data() + sent, message.size() - sent, MSG_NOSIGNAL);
    if (count > 0)
    {
      sent += static_cast<std::size_t>(count);
      continue;
    }
    if (errno != EAGAIN && errno != EWOULDBLOCK && errno != EINTR)
    {
      closed_ = true;
      break;
    }
    if (sent == 0 && errno != EINTR)
    {
      return false;
    }
    pollfd wait{socket_, POLLOUT, 0};
    if (poll(&wait, 1, kSending) == 0)
    {
      closed_ = true;  // half a message would spoil all that follow
    }
  }
  return !closed_;
}

}  // namespace bigus::command
