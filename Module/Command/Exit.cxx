// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Exit.h"

#include <csignal>
#include <utility>

namespace bigus::command
{

namespace
{

volatile std::sig_atomic_t interrupted = 0;

extern "C" void OnSignal(int number)
{
  interrupted = number;
  if (number != SIGPIPE)  // which comes with every further line, also while a field is saved
  {
    std::signal(number, SIG_DFL);
  }
}

}  // namespace

void ListenToSignals()
{
  for (const int number : {SIGINT, SIGTERM, SIGHUP, SIGPIPE, SIGALRM, SIGUSR1, SIGUSR2, SIGXCPU})
  {
    if (std::signal(number, OnSignal) == SIG_IGN)  // nohup, or a shell's background job
    {
      std::signal(number, SIG_IGN);
    }
  }
}

bool IsInterrupted()
{
  return interrupted != 0;
}

std::string WithRemedy(const std::string& message)
{
  const std::pair<const char*, const char*> remedies[] = {
      {"no way from", " (--image-from, --image-to and --config)"},
      {"name that coordinate frame", " (--image-from)"},
      {"set the image spacing", " (--pixel-spacing)"},
      {"set the pixel range", " (--pixel-range)"},
      {"MaximumOutputPixels", " (--spacing, --size or --region)"},
      {"Divide by the largest value of the original type", " (--pixel-range does so)"},
      {"without a status", " (--assume-status accepts transforms without a status)"}};
  for (const auto& [phrase, remedy] : remedies)
  {
    if (message.find(phrase) != std::string::npos)
    {
      return message + remedy;
    }
  }
  return message;
}

ExitCode InterruptedCode()
{
  return static_cast<ExitCode>(Stopped + interrupted);
}

}  // namespace bigus::command
