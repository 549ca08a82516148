// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Slices of a live field for several clients that speak OpenIGTLink.
#pragma once

#include <Eigen/Dense>
#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "Live/IgtConnection.h"

namespace bigus::command
{

class LiveStatus;
class Looker;

/// The IMAGE of the device BigusSlice: the field at a plane, `size` pixels across and down.
std::vector<std::uint8_t> SliceMessage(Looker& looker, const Eigen::Matrix4d& imageToWorld, double timestamp,
                                       const std::vector<int>& size);

/// Programs of this machine connect to a port and send TRANSFORM, pixels of a slice to mm; each is answered by the slice.
/// Those that show more of a field send STRING, a question of JSON, as Module/Command/Live.md tells.
/// Clients take turns: of each only the newest question waits, and between two frames that arrive one is answered, or
/// more while no frame is there. It has no thread of its own, and works while Wait is called.
class SliceServer
{
public:
  /// `port` 0: no clients. `device`: whose TRANSFORM counts; empty: any. Throws Error when the port is taken.
  SliceServer(int port, std::string device, std::vector<int> size, Looker& looker, const LiveStatus& status);
  ~SliceServer();
  SliceServer(const SliceServer&) = delete;
  SliceServer& operator=(const SliceServer&) = delete;

  /// Serves clients for so many seconds, or until `socket` (-1: none) can be read.
  void Wait(int socket, double seconds);

private:
  struct Question
  {
    double timestamp = 0;
    std::optional<Eigen::Matrix4d> plane;  // of a TRANSFORM
    std::string text;                      // of a STRING
  };
  struct Client
  {
    std::unique_ptr<IgtConnection> connection;
    std::optional<Question> question;  // that waits for its answer
  };
  void Accept();
  bool Hear(Client& client) const;
  void AnswerNext();
  std::vector<std::uint8_t> Answer(const Question& question) const;

  std::string device_;
  std::vector<int> size_;
  Looker& looker_;
  const LiveStatus& status_;
  int listener_ = -1;
  std::vector<Client> clients_;
  std::size_t next_ = 0;  // whose turn it is
};

}  // namespace bigus::command
