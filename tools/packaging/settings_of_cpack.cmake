# SPDX-License-Identifier: Apache-2.0
# Read by CPack when it runs.
if(NOT CPACK_INSTALL_CMAKE_PROJECTS) # the sources
  set(CPACK_PRE_BUILD_SCRIPTS ${CMAKE_CURRENT_LIST_DIR}/add_uplot.cmake)
endif()
