// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// bigus: tracked ultrasound sweeps to Gaussian fields, and slices of them at any plane, from the shell.
#include "Command.h"

int main(int argumentCount, char** arguments)
{
  return bigus::command::Run(argumentCount, arguments);
}
