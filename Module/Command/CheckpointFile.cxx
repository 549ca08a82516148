// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "CheckpointFile.h"

#include <filesystem>

#include "Exit.h"
#include "IO/AtomicFile.h"
#include "IO/FileError.h"
#include "IO/Text.h"

namespace bigus::command
{

CheckpointFile::CheckpointFile(const std::string& output, Console& console)
    : path_(output + ".checkpoint"), console_(console)
{
}

bool CheckpointFile::Exists() const
{
  std::error_code ignored;
  return std::filesystem::is_regular_file(path_, ignored);
}

Checkpoints CheckpointFile::Open(double interval, bool resumes)
{
  Checkpoints checkpoints;
  checkpoints.interval = interval;
  if (resumes && Exists())
  {
    InputFile file(path_);
    checkpoints.resume.resize(file.Size());
    checkpoints.resume.resize(file.Read(checkpoints.resume.data(), checkpoints.resume.size()));
    if (checkpoints.resume.empty())
    {
      throw Error(path_ + ": the file is empty. Leave out --resume to begin anew.");
    }
    console_.Note("Going on from " + path_ + ".");
  }
  else if (resumes)
  {
    console_.Note("There is no " + path_ + " to go on from, so training begins.");
  }
  else if (Exists())
  {
    console_.Note(path_ +
                  " holds a training that was not finished. --resume would go on with it; this training replaces it.");
  }
  if (interval > 0)
  {
    checkpoints.save = [this](const std::string& state)
    {
      if (IsInterrupted())
      {
        waiting_ = state;
        return;
      }
      Write(state);
    };
  }
  return checkpoints;
}

void CheckpointFile::WriteWhatWaits()
{
  if (!waiting_.empty())
  {
    Write(waiting_);
    waiting_.clear();
  }
}

/// A checkpoint that cannot be written does not end the training; the one before is kept.
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
    if (!hasFailed_)
    {
      console_.Note(std::string("bigus: warning: ") + error.what() + ". Training goes on without a new checkpoint.");
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

}  // namespace bigus::command
