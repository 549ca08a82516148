// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What training makes small, as text on the command line.
#include "Core/Engine/Loss.h"

#include "Fuzz/Harness.h"

namespace bigus::fuzz
{

void TryInput(const std::string& bytes)
{
  RunAsProgram(
      [&bytes](command::Console& console)
      {
        const Loss loss = Loss::Parse(bytes);
        const Loss again = Loss::Parse(loss.ToString());
        if (loss.ToString() != again.ToString())
        {
          Finding("'" + loss.ToString() + "' reads back as '" + again.ToString() + "'");
        }
        console.Print(loss.ToString());
        return command::Success;
      });
}

}  // namespace bigus::fuzz
