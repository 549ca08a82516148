# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
# What reads and writes files without VTK: compiled into the module IO, and into the Python package without VTK.
set(bigus_parsers
  AtomicFile.cxx
  CheckpointFile.cxx
  FieldFile.cxx
  FrameGeometry.cxx
  Formats/Hdf5Transform.cxx
  Formats/HeaderFields.cxx
  Formats/LinearTransform.cxx
  Formats/Markups.cxx
  Formats/MetaImageHeader.cxx
  Formats/NrrdHeader.cxx
  Formats/Ply.cxx
  Formats/PictureNames.cxx
  Formats/PngFile.cxx
  Formats/PoseCsv.cxx
  Formats/Pvtp.cxx
  Formats/VolumeGrid.cxx
  Formats/Vtp.cxx
  Formats/Xml.cxx
  PlaneFile.cxx
  Poses.cxx
  SequenceFile.cxx
  SequenceFrames.cxx
  SequenceOutput.cxx
  SequencePixels.cxx
  SequenceTimes.cxx
  Text.cxx
  UnusedFields.cxx)
list(TRANSFORM bigus_parsers PREPEND "${CMAKE_CURRENT_LIST_DIR}/")

find_package(nlohmann_json REQUIRED)
find_package(pugixml REQUIRED GLOBAL)  # tests read XML, too
find_package(ZLIB REQUIRED)
find_path(SPNG_INCLUDE_DIR spng.h REQUIRED)
find_library(SPNG_LIBRARY spng REQUIRED)
