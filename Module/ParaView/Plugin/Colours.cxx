// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Colours.h"

#include "vtkSMSettings.h"

void bigusShowPicturesInGrey()
{
  const double priority = 0.5;  // above ParaView's own, below the user's
  vtkSMSettings::GetInstance()->AddCollectionFromString(
      R"({"standard_presets": {"Intensity": "Grayscale", "Recorded": "Grayscale"}})", priority);
}
