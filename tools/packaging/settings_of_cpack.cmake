# SPDX-License-Identifier: Apache-2.0
# Read by CPack when it runs.
if(NOT CPACK_INSTALL_CMAKE_PROJECTS) # the sources
  set(CPACK_PRE_BUILD_SCRIPTS ${CMAKE_CURRENT_LIST_DIR}/add_uplot.cmake)
elseif(CPACK_GENERATOR STREQUAL DEB)
  set(CPACK_PRE_BUILD_SCRIPTS ${CMAKE_CURRENT_LIST_DIR}/add_debian_files.cmake)
  # DESTDIR, so that the installation knows its prefix.
  set(CPACK_SET_DESTDIR ON)
  set(CPACK_INSTALL_PREFIX /usr)
  set(CPACK_STRIP_FILES ON)
  set(ENV{SOURCE_DATE_EPOCH} ${CPACK_STICKSLIP_DATE})
endif()
