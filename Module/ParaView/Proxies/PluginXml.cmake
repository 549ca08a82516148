# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
# ParaView's XML, made of one file a proxy: ${bigus_plugin_xml}, by the target bigusPluginXml. The plugin's project includes
# this, and so does BIGUS, for the plugin in Python and for tests.
set(bigus_plugin_xml "${CMAKE_BINARY_DIR}/paraview/bigus.xml")
file(GLOB bigus_proxies CONFIGURE_DEPENDS "${CMAKE_CURRENT_LIST_DIR}/../../../*/*/Proxies/*.xml")  # also those of wings
file(GLOB bigus_shared_xml CONFIGURE_DEPENDS "${CMAKE_CURRENT_LIST_DIR}/Shared/*.xml")

add_executable(bigusMakePluginXml "${CMAKE_CURRENT_LIST_DIR}/MakePluginXml.cxx")
target_link_libraries(bigusMakePluginXml PRIVATE BIGUS::Core)
# It runs in the build tree alone, where a wheel's Core lies beside the package.
set_target_properties(bigusMakePluginXml PROPERTIES INSTALL_RPATH "$<TARGET_FILE_DIR:BIGUS::Core>")
target_compile_options(bigusMakePluginXml PRIVATE ${BIGUS_WARNINGS})
file(MAKE_DIRECTORY "${CMAKE_BINARY_DIR}/paraview")
add_custom_command(OUTPUT "${bigus_plugin_xml}"
  COMMAND bigusMakePluginXml "${bigus_plugin_xml}" "${CMAKE_CURRENT_LIST_DIR}/Shared" ${bigus_proxies}
  DEPENDS bigusMakePluginXml ${bigus_proxies} ${bigus_shared_xml})
add_custom_target(bigusPluginXml ALL DEPENDS "${bigus_plugin_xml}")
