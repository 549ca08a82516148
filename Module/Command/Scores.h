// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Scores as `metrics` and `train` report them.
#pragma once

#include "Console.h"
#include "Core/Metrics/Texture.h"

namespace bigus::command
{

/// Every number under the name of its table column in snake case ("image_contrast_mean"), and the spectra:
/// `spectrum_frequency` in cycles a pixel, `image_spectrum`, `truth_spectrum`.
Json TextureJson(const TextureComparison& texture);

/// The same for people, on stdout.
void PrintTexture(const TextureComparison& texture, Console& console);

/// What matters of it, on one line.
std::string TextureLine(const TextureComparison& texture);

}  // namespace bigus::command
