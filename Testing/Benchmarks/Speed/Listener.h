// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Who runs the measurements: gets lines and progress, and may ask to stop.
#pragma once

#include <exception>
#include <string>

namespace bigus::bench
{

class Listener
{
public:
  virtual ~Listener() = default;
  virtual void Print(const std::string& line) = 0;  ///< a line of the answer
  virtual void Note(const std::string& line) = 0;   ///< a line about what is going on
  virtual void Progress(const std::string& job, double fraction) = 0;
  virtual void EndProgress() = 0;
  virtual bool IsInterrupted() const = 0;  ///< true once the measurements are to stop
};

/// Thrown where measurements stop because the listener asked for it.
class Interrupted : public std::exception
{
};

}  // namespace bigus::bench
