// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "IO/CheckpointFile.h"

#include <filesystem>
#include <utility>

#include "IO/AtomicFile.h"
#include "IO/FileError.h"
#include "IO/Text.h"

namespace bigus
{

CheckpointFile::CheckpointFile(std::string path, std::function<void(const std::string&)> warn)
    : path_(std::move(path)), warn_(std::move(warn))
{
}

CheckpointFile::~CheckpointFile() = default;

void CheckpointFile::Lock()
{
  lock_ = std::make_unique<FileLock>(path_, FileLock::Mode::Try);
  Require(FileFault::CannotOpen, lock_->IsHeld(), path_, ": another training keeps its state there (its lock is ",
          lock_->Name(), "). Wait for it, or write to another name");
}

void CheckpointFile::Unlock()
{
  lock_.reset();
}

bool CheckpointFile::Exists() const
{
  std::error_code ignored;
  return std::filesystem::is_regular_file(path_, ignored);
}

std::string CheckpointFile::Read() const
{
  InputFile file(path_);
  std::string state(file.Size(), '\0');
  state.resize(file.Read(state.data(), state.size()));
  Require(!state.empty(), path_, ": the file is empty, so there is nothing to resume. Begin anew without it.");
  return state;
}

void CheckpointFile::Write(const std::string& state)
{
  try
  {
    AtomicFile file(path_);
    file.Write(state);
    file.Commit();
    hasFailed_ = false;
  }
  catch (const FileError& error)
  {
    if (!hasFailed_ && warn_)
    {
      warn_(std::string(error.what()) + ". Training goes on without a new checkpoint.");
    }
    hasFailed_ = true;
  }
}

void CheckpointFile::Remove()
{
  if (Exists())
  {
    std::error_code ignored;
    std::filesystem::remove(path_, ignored);
  }
}

}  // namespace bigus
