// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What is refused, and with which words.
#pragma once

#include <gtest/gtest.h>

#include <initializer_list>
#include <string>

#include "Core/Model/Error.h"

namespace bigus::test
{

/// The message of the Error that `action` throws, or "" when it throws none.
template <class Action>
std::string Message(Action&& action)
{
  try
  {
    action();
  }
  catch (const Error& error)
  {
    return error.what();
  }
  return "";
}

/// Expects an Error whose message holds every one of `parts`.
template <class Action>
void ExpectRefused(Action&& action, std::initializer_list<std::string> parts)
{
  const std::string message = Message(action);
  EXPECT_FALSE(message.empty()) << "nothing was refused";
  for (const std::string& part : parts)
  {
    EXPECT_NE(message.find(part), std::string::npos) << "'" << part << "' is missing in: " << message;
  }
}

}  // namespace bigus::test
