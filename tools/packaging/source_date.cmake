# SPDX-License-Identifier: Apache-2.0
# STICKSLIP_DATE: the date of the sources in seconds since 1970, for manual pages and packages that do not
# depend on the time of their build. It is that of the last commit; of an archive, that of its CHANGELOG.md.
set(STICKSLIP_DATE $ENV{SOURCE_DATE_EPOCH})
find_program(STICKSLIP_GIT git)
if(NOT STICKSLIP_DATE AND STICKSLIP_GIT AND EXISTS ${CMAKE_SOURCE_DIR}/.git)
  execute_process(COMMAND ${STICKSLIP_GIT} -c safe.directory=* -C ${CMAKE_SOURCE_DIR} log -1 --format=%ct
    OUTPUT_VARIABLE STICKSLIP_DATE OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
endif()
if(NOT STICKSLIP_DATE)
  file(TIMESTAMP ${CMAKE_SOURCE_DIR}/CHANGELOG.md STICKSLIP_DATE %s UTC)
endif()
set(ENV{SOURCE_DATE_EPOCH} ${STICKSLIP_DATE}) # of string(TIMESTAMP)
