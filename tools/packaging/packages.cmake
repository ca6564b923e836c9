# SPDX-License-Identifier: Apache-2.0
# Archives and packages, by CPack:
#   cpack -G TGZ --config CPackSourceConfig.cmake    the sources, with uPlot, so that they build offline
set(CPACK_PACKAGE_VENDOR "Stickslip")
set(CPACK_VERBATIM_VARIABLES ON)
set(CPACK_PROJECT_CONFIG_FILE ${CMAKE_CURRENT_LIST_DIR}/settings_of_cpack.cmake)

string(REGEX REPLACE "([][+.*()^$?|\\\\{}])" "\\\\\\1" root "${CMAKE_SOURCE_DIR}")
set(CPACK_SOURCE_GENERATOR TGZ)
set(CPACK_SOURCE_PACKAGE_FILE_NAME ${PROJECT_NAME}-${PROJECT_VERSION})
set(CPACK_SOURCE_IGNORE_FILES
  "^${root}/build(/|-)" "^${root}/\\.git(/|$)" /__pycache__/ "\\.pyc$" "/compile_commands\\.json$")
include(CPack)
