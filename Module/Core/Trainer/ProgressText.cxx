// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Trainer/ProgressText.h"

#include <cmath>
#include <locale>
#include <sstream>

namespace bigus
{

std::string ProgressText(const TrainingProgress& progress)
{
  using Phase = TrainingProgress::Phase;
  std::ostringstream line;
  line.imbue(std::locale::classic());
  switch (progress.phase)
  {
    case Phase::Deciding:
      line << "deciding what the sweep needs";
      break;
    case Phase::Seeding:
      line << "seeding";
      break;
    case Phase::Training:
      line << "iteration " << progress.record.iteration << ", loss " << progress.record.loss;
      break;
  }
  if (progress.record.validationPsnr)
  {
    line << ", validation " << *progress.record.validationPsnr << " dB";
  }
  if (progress.secondsLeft > 0)
  {
    line << ", " << std::lround(progress.secondsLeft) << " s left";
  }
  return line.str();
}

}  // namespace bigus
