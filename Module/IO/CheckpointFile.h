// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The file that holds the state of a training until that is finished.
#pragma once

#include <functional>
#include <memory>
#include <string>

namespace bigus
{

class FileLock;

class CheckpointFile
{
public:
  /// `warn` (may be empty) is told once, not for every attempt, that the file cannot be written.
  explicit CheckpointFile(std::string path, std::function<void(const std::string&)> warn = {});
  ~CheckpointFile();

  const std::string& Path() const { return path_; }
  bool Exists() const;

  /// From here on no other training keeps its state here. Throws FileError where another does.
  void Lock();
  void Unlock();

  /// The state to go on from: Checkpoints::resume. Throws Error when the file cannot be read or is empty.
  std::string Read() const;

  /// Checkpoints::save. A file that cannot be written does not end a training; the one before is kept.
  void Write(const std::string& state);

  /// The training is finished.
  void Remove();

private:
  std::string path_;
  std::function<void(const std::string&)> warn_;
  std::unique_ptr<FileLock> lock_;
  bool hasFailed_ = false;
};

}  // namespace bigus
