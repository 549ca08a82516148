// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Whether there is a screen to draw on.
#pragma once

namespace bigus::command
{

/// Throws OutputError where no window can be made, also none off screen: VTK would abort the program.
void RequireDisplay();

}  // namespace bigus::command
