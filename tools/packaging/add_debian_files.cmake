# SPDX-License-Identifier: Apache-2.0
# Run by CPack on the installed files before it packs them: adds what Debian expects of a package and an
# installation from source does not have.
set(root ${CPACK_TEMPORARY_DIRECTORY}/stickslip)
set(doc ${root}/usr/share/doc/stickslip)
set(readable OWNER_READ OWNER_WRITE GROUP_READ WORLD_READ)

# The configuration that the unit runs: the simulated rig.
foreach(file IN LISTS CPACK_STICKSLIP_CONFFILES)
  string(REPLACE /etc/stickslip/rig.toml /etc/stickslip/simulated.toml shipped ${file})
  string(REPLACE /etc/ ${root}/usr/share/ shipped ${shipped})
  configure_file(${shipped} ${root}${file} COPYONLY)
endforeach()

# Licences: ours, that of the page's library, and those of libraries of which only headers are used.
configure_file(${CMAKE_CURRENT_LIST_DIR}/copyright ${doc}/copyright COPYONLY)
if(EXISTS ${doc}/uplot-license.txt)
  file(READ ${doc}/uplot-license.txt text)
  string(STRIP "${text}" text)
  string(REGEX REPLACE "\n\n" "\n.\n" text "${text}")
  string(REGEX REPLACE "\n" "\n " text "${text}")
  if(NOT text MATCHES "Copyright \\(c\\) ([^\n]+)")
    message(FATAL_ERROR "uplot-license.txt names no holder of its copyright")
  endif()
  file(APPEND ${doc}/copyright "
Files: usr/bin/stickslip
Copyright: ${CMAKE_MATCH_1}
License: Expat
 ${text}
Comment: Of uPlot, in the page of the live view. The rest of the program is as above.
")
endif()
set(headers libcli11-dev libeigen3-dev nlohmann-json3-dev)
foreach(package libreaderwriterqueue-dev ${headers})
  configure_file(/usr/share/doc/${package}/copyright ${doc}/licences/${package} COPYONLY)
endforeach()
set(python_root ${CPACK_TEMPORARY_DIRECTORY}/python)
if(EXISTS ${python_root})
  set(python_doc ${python_root}/usr/share/doc/python3-stickslip)
  configure_file(${CMAKE_CURRENT_LIST_DIR}/copyright ${python_doc}/copyright COPYONLY)
  foreach(package pybind11-dev ${headers})
    configure_file(/usr/share/doc/${package}/copyright ${python_doc}/licences/${package} COPYONLY)
  endforeach()
endif()

file(REMOVE ${doc}/LICENSE)
file(RENAME ${doc}/CHANGELOG.md ${doc}/changelog)
file(GLOB_RECURSE compressed ${root}/usr/share/man/*.[18])
execute_process(COMMAND gzip --best --no-name ${compressed} ${doc}/changelog COMMAND_ERROR_IS_FATAL ANY)

# Whatever the umask of the build is.
file(GLOB_RECURSE files LIST_DIRECTORIES true ${root}/* ${python_root}/*)
foreach(file IN LISTS files)
  if(IS_DIRECTORY ${file} OR file MATCHES /usr/bin/)
    file(CHMOD ${file} PERMISSIONS ${readable} OWNER_EXECUTE GROUP_EXECUTE WORLD_EXECUTE)
  else()
    file(CHMOD ${file} PERMISSIONS ${readable})
  endif()
endforeach()
