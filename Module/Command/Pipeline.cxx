// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Pipeline.h"

#include <vtkAlgorithm.h>
#include <vtkCallbackCommand.h>
#include <vtkCommand.h>
#include <vtkLogger.h>
#include <vtkNew.h>
#include <vtkObjectFactory.h>
#include <vtkOutputWindow.h>
#include <vtkSmartPointer.h>

#include <string_view>
#include <vector>

#include "Console.h"
#include "Exit.h"

namespace bigus::command
{

namespace
{

/// The length of "(0x55d0c3a2)" at the text's start; 0 where there is none.
std::size_t AddressLength(std::string_view text)
{
  constexpr std::string_view start = "(0x";
  if (text.substr(0, start.size()) != start)
  {
    return 0;
  }
  const std::size_t end = text.find_first_not_of("0123456789abcdef", start.size());
  return end != std::string_view::npos && end > start.size() && text[end] == ')' ? end + 1 : 0;
}

/// "ERROR: In file.cxx, line 12\nvtkClass (0x...): what happened\n\n" to "what happened". Searches by hand, because a
/// hostile file chooses how long the message is, and std::regex would call itself once for every character of it.
std::string Essence(const char* text)
{
  std::string_view rest = text ? text : "";
  for (const std::string_view origin : {"ERROR: In ", "Warning: In ", "Generic Warning: In "})
  {
    if (const std::size_t line = rest.find('\n');
        rest.substr(0, origin.size()) == origin && line != std::string_view::npos)
    {
      rest.remove_prefix(line + 1);
      break;
    }
  }
  // The class that complains.
  const std::size_t space = rest.find(' ');
  if (const std::size_t length = space == std::string_view::npos ? 0 : AddressLength(rest.substr(space + 1));
      length > 0 && rest.substr(space + 1 + length, 2) == ": ")
  {
    rest.remove_prefix(space + 1 + length + 2);
  }
  // Addresses of other objects.
  std::string message;
  message.reserve(rest.size());
  for (std::size_t at = 0; at < rest.size(); ++at)
  {
    if (const std::size_t length = rest[at] == ' ' ? AddressLength(rest.substr(at + 1)) : 0)
    {
      at += length;
      continue;
    }
    message += rest[at];
  }
  message.erase(message.find_last_not_of(" \n\r\t") + 1);
  return message;
}

/// Takes VTK's messages instead of the terminal.
class MessageWindow : public vtkOutputWindow
{
public:
  vtkTypeMacro(MessageWindow, vtkOutputWindow);
  static MessageWindow* New();

  void DisplayErrorText(const char* text) override { errors.push_back(Essence(text)); }
  void DisplayText(const char*) override {}
  void DisplayDebugText(const char*) override {}
  void DisplayWarningText(const char* text) override { Warn(text); }
  void DisplayGenericWarningText(const char* text) override { Warn(text); }

  Console* console = nullptr;
  std::vector<std::string> errors;

private:
  void Warn(const char* text)
  {
    if (console)
    {
      console->Note("bigus: warning: " + WithRemedy(Essence(text)));
    }
  }
};
vtkStandardNewMacro(MessageWindow);

MessageWindow* Messages()
{
  static vtkNew<MessageWindow> window;
  return window;
}

struct Watch
{
  Console* console;
  const std::string* job;
  Part part;
  bool stoppable;
};

void OnProgress(vtkObject* caller, unsigned long, void* clientData, void*)
{
  const Watch* watch = static_cast<Watch*>(clientData);
  auto* algorithm = static_cast<vtkAlgorithm*>(caller);
  const char* text = algorithm->GetProgressText();
  watch->console->Progress(*watch->job, (watch->part.index + algorithm->GetProgress()) / watch->part.count,
                           text ? text : "");
  if (watch->stoppable && IsInterrupted())
  {
    if (!algorithm->GetAbortExecute())  // a step may take seconds, in which nothing else would be seen
    {
      watch->console->Note("bigus: stopping at the end of this step; a second Ctrl-C ends at once and saves nothing.");
    }
    algorithm->SetAbortExecute(1);
  }
}

/// Returns the first error, or nothing.
std::string Execute(vtkAlgorithm* algorithm, Console& console, const std::string& job, Part part, bool stoppable)
{
  Messages()->errors.clear();
  Watch watch{&console, &job, part, stoppable};
  vtkNew<vtkCallbackCommand> command;
  command->SetCallback(OnProgress);
  command->SetClientData(&watch);
  const unsigned long tag = algorithm->AddObserver(vtkCommand::ProgressEvent, command);
  algorithm->Update();
  algorithm->RemoveObserver(tag);
  if (part.index + 1 == part.count)
  {
    console.EndProgress();
  }
  if (!Messages()->errors.empty())
  {
    return Messages()->errors.front();
  }
  return algorithm->GetErrorCode() ? "The job failed without saying why." : "";
}

}  // namespace

void CatchVtkMessages(Console& console)
{
  Messages()->console = &console;
  vtkOutputWindow::SetInstance(Messages());
  vtkLogger::SetStderrVerbosity(vtkLogger::VERBOSITY_OFF);  // it would print every message once more
}

void Update(vtkAlgorithm* algorithm, Console& console, const std::string& job, Part part)
{
  const std::string fault = Execute(algorithm, console, job, part, true);
  if (IsInterrupted())
  {
    throw Interrupted();
  }
  if (!fault.empty())
  {
    throw Error(fault);
  }
}

void UpdateUntilInterrupted(vtkAlgorithm* algorithm, Console& console, const std::string& job)
{
  if (const std::string fault = Execute(algorithm, console, job, {}, true); !fault.empty())
  {
    throw Error(fault);
  }
}

void RequireDone(bool done)
{
  Require(done, Messages()->errors.empty() ? "The job failed without saying why." : Messages()->errors.front());
}

void UpdateInformation(vtkAlgorithm* algorithm)
{
  Messages()->errors.clear();
  algorithm->UpdateInformation();
  if (!Messages()->errors.empty())
  {
    throw Error(Messages()->errors.front());
  }
}

void Write(vtkAlgorithm* writer, Console& console, const std::string& job)
{
  if (const std::string fault = Execute(writer, console, job, {}, false); !fault.empty())
  {
    throw OutputError(fault);
  }
}

}  // namespace bigus::command
