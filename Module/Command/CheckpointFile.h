// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The file beside an output that holds the state of its training until that is finished.
#pragma once

#include <string>

#include "Console.h"
#include "Core/Deciding/Trainer.h"

namespace bigus::command
{

class CheckpointFile
{
public:
  /// Of a training that writes `output`.
  CheckpointFile(const std::string& output, Console& console);

  const std::string& Path() const { return path_; }
  bool Exists() const;

  /// Reads the state to go on from, where that is asked for and there is one, and says what it does with the file.
  /// Throws Error when the file cannot be read.
  Checkpoints Open(double interval, bool resumes);

  /// After an interruption the state waits for this, because the field is written first.
  void WriteWhatWaits();
  /// The training is finished.
  void Remove();

private:
  void Write(const std::string& state);

  std::string path_;
  Console& console_;
  std::string waiting_;
  bool hasFailed_ = false;
};

}  // namespace bigus::command
