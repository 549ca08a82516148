// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The file that holds the state of a training until that is finished.
#pragma once

#include <functional>
#include <string>

namespace bigus
{

class CheckpointFile
{
public:
  /// `warn` (may be empty) is told once, not for every attempt, that the file cannot be written.
  explicit CheckpointFile(std::string path, std::function<void(const std::string&)> warn = {});

  const std::string& Path() const { return path_; }
  bool Exists() const;

  /// The state to go on from: Checkpoints::resume. Throws Error when the file cannot be read or is empty.
  std::string Read() const;

  /// Checkpoints::save. A file that cannot be written does not end a training; the one before is kept.
  void Write(const std::string& state);

  /// The training is finished.
  void Remove();

private:
  std::string path_;
  std::function<void(const std::string&)> warn_;
  bool hasFailed_ = false;
};

}  // namespace bigus
