// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// One Gaussian, seen by a plane through its centre: as bright as it should be.
#include <Core/Engine/Engine.h>

#include <cmath>
#include <iostream>
#include <vector>

int main()
{
  bigus::GaussianField field;
  field.Resize(1);
  field.means[0] = {4, 3, 0};
  field.scales[0] = {1, 1, 1};
  field.rotations[0] = {1, 0, 0, 0};
  field.reflectivities[0] = 2;
  field.beam.elevationSigma = 0;
  field.transfer.gamma = 0.5;

  bigus::SlicePlane plane;
  plane.width = 9;
  plane.height = 7;
  std::vector<float> image(plane.NumberOfPixels());
  const auto engine = bigus::Engine::Create("cpu");
  engine->SetField(field);
  engine->Render(plane, bigus::ViewOutput::Intensity, image.data());

  const double expected = 1 - std::exp(-1.0);
  const double found = image[3 * plane.width + 4];
  std::cout << engine->Device() << ": " << found << ", expected " << expected << "\n";
  return std::abs(found - expected) < 1e-3 ? 0 : 1;
}
