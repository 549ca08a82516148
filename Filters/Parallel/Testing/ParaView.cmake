# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
# The tests of the plugin's project. Two processes and a client: a damaged piece is part of it, so errors are expected.
find_program(BIGUS_mpiexec NAMES mpiexec mpirun)
if(BIGUS_pvserver AND BIGUS_pvpython AND BIGUS_mpiexec)
  file(MAKE_DIRECTORY "${CMAKE_BINARY_DIR}/Testing/server")
  bigus_paraview_test(server /usr/bin/python3 "${CMAKE_CURRENT_LIST_DIR}/paraview_server.py" "${BIGUS_pvserver}"
    "${BIGUS_pvpython}" "${BIGUS_mpiexec}" "${bigus_compiled}" "${CMAKE_BINARY_DIR}/Testing/server")
  set_tests_properties(paraview.server PROPERTIES LABELS "paraview;parallel"
    FAIL_REGULAR_EXPRESSION "Traceback" SKIP_REGULAR_EXPRESSION "skipped:")
endif()
