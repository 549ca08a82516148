// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

/// Arrays that hold ultrasound, Intensity and Recorded, are grey where the user's settings name no other preset.
void bigusShowPicturesInGrey();
