// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A connection to an OpenIGTLink server, such as PlusServer or 3D Slicer.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "Live/OpenIgtLink.h"

namespace bigus::command
{

/// "igtl://HOST:PORT" or "igtl://HOST", whose port is then 18944, taken apart.
struct IgtAddress
{
  std::string host, port;

  static bool IsOne(const std::string& text);
  /// Throws Error for what is no such address.
  static IgtAddress Parse(const std::string& text);
};

class IgtConnection
{
public:
  struct Message
  {
    IgtHeader header;
    std::vector<std::uint8_t> body;
  };

  /// Connects, within so many seconds. Throws Error when nobody listens there.
  IgtConnection(const IgtAddress& address, double seconds);
  /// Of a client that was accepted, as a socket that does not block. Messages with larger bodies are none.
  IgtConnection(int socket, std::size_t largestBody) : socket_(socket), largestBody_(largestBody) {}
  ~IgtConnection();
  IgtConnection(const IgtConnection&) = delete;
  IgtConnection& operator=(const IgtConnection&) = delete;

  /// What ended Receive.
  enum class Event
  {
    Message,
    Silence,  ///< nothing came for so long; the rest of a message may still come
    Closed    ///< by the other side
  };
  /// Waits for the next message, at most `seconds`. Throws Error for bytes that are no message.
  Event Receive(double seconds, Message& message);

  /// Sends a whole message. False when it cannot be sent at once, because the other side does not read: it is left out.
  bool Send(const std::vector<std::uint8_t>& message);

  /// To wait for together with others.
  int Socket() const { return socket_; }

private:
  bool Fill(std::size_t bytes);

  int socket_ = -1;
  std::vector<std::uint8_t> received_;  // of the message that is under way
  bool closed_ = false;
  std::size_t largestBody_ = SIZE_MAX;
};

}  // namespace bigus::command
