// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Display.h"

#include <dlfcn.h>

#include <cstdlib>
#include <string>

#include "Exit.h"
#include "vtkVersionMacros.h"

namespace bigus::command
{

void RequireDisplay()
{
  // Where VTK draws on Linux without X11, or can do without, it says itself what it lacks.
#if defined(__linux__) && VTK_VERSION_NUMBER < VTK_VERSION_CHECK(9, 4, 0)
  const char* const remedy = " Run it on a desktop or with ssh -X; --screenshot also works under xvfb-run.";
  const char* const name = std::getenv("DISPLAY");
  RequireOutput(name && *name, "There is no X server to draw on: DISPLAY is not set.", remedy);
  // Asked of the library that VTK uses. It is loaded here because its headers are not needed for anything else. Where it
  // is missing, VTK cannot have been loaded either.
  void* const library = dlopen("libX11.so.6", RTLD_NOW);
  if (!library)
  {
    return;
  }
  const auto open = reinterpret_cast<void* (*)(const char*)>(dlsym(library, "XOpenDisplay"));
  const auto query = reinterpret_cast<int (*)(void*, const char*, int*, int*, int*)>(dlsym(library, "XQueryExtension"));
  const auto close = reinterpret_cast<int (*)(void*)>(dlsym(library, "XCloseDisplay"));
  if (!open || !query || !close)
  {
    return;
  }
  void* const display = open(nullptr);
  RequireOutput(display, "The X server of DISPLAY=", name, " does not answer.", remedy);
  int opcode = 0, event = 0, error = 0;
  const bool hasOpenGl = query(display, "GLX", &opcode, &event, &error) != 0;
  close(display);
  RequireOutput(hasOpenGl, "The X server of DISPLAY=", name, " cannot draw with OpenGL (GLX).", remedy);
#endif
}

}  // namespace bigus::command
