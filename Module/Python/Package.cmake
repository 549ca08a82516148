# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
# bigus_add_package(<target> FOLDER <folder> INSTALL <destination> [<option of install(FILES)>...])
# A Python package: its files lie in a folder of the build tree and are installed.
function(bigus_add_package target)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "FOLDER" "INSTALL")
  add_custom_target(${target} ALL)
  set_target_properties(${target} PROPERTIES BIGUS_FOLDER "${arg_FOLDER}" BIGUS_INSTALL "${arg_INSTALL}")
endfunction()

# bigus_add_to_package(<target> <file>...)
# Adds files, whose paths count from the calling folder, to a package, where that is built.
function(bigus_add_to_package target)
  if(NOT TARGET ${target})
    return()
  endif()
  get_target_property(folder ${target} BIGUS_FOLDER)
  get_target_property(install ${target} BIGUS_INSTALL)
  foreach(file IN LISTS ARGN)
    cmake_path(ABSOLUTE_PATH file)
    cmake_path(GET file FILENAME name)
    add_custom_command(OUTPUT "${folder}/${name}"
      COMMAND "${CMAKE_COMMAND}" -E copy "${file}" "${folder}/${name}"
      DEPENDS "${file}")
    list(APPEND copied_files "${folder}/${name}")
    install(FILES "${file}" DESTINATION ${install})
  endforeach()
  cmake_path(GET CMAKE_CURRENT_SOURCE_DIR FILENAME room)
  add_custom_target(${target}${room}Files DEPENDS ${copied_files})
  add_dependencies(${target} ${target}${room}Files)
endfunction()
