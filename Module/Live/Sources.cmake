# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
# What needs no VTK becomes part of Core, because it computes with Core's OpenCV, which is hidden in a wheel. ParaView's
# plugin includes this, too.
target_sources(BIGUSCore PRIVATE "${CMAKE_CURRENT_LIST_DIR}/LiveSession.cxx" "${CMAKE_CURRENT_LIST_DIR}/LiveTraining.cxx")
