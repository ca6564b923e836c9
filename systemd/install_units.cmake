# SPDX-License-Identifier: Apache-2.0
# Part of the installation: writes the units for its prefix. As everywhere in Debian, the configuration of
# programs in /usr is in /etc.
set(STICKSLIP_PROGRAMS ${CMAKE_INSTALL_PREFIX}/bin)
cmake_path(ABSOLUTE_PATH documents BASE_DIRECTORY ${CMAKE_INSTALL_PREFIX})
set(STICKSLIP_DOCUMENTS ${documents}/docs)
set(parent ${CMAKE_INSTALL_PREFIX})
if(parent STREQUAL /usr)
  set(parent /)
endif()
cmake_path(ABSOLUTE_PATH configuration BASE_DIRECTORY ${parent})
set(STICKSLIP_CONFIG_FOLDER ${configuration}/stickslip)
# A folder per installation: several may run at a time.
string(SHA1 name "$ENV{DESTDIR}${CMAKE_INSTALL_PREFIX}")
foreach(unit IN LISTS units)
  configure_file(${unit_sources}/${unit}.service.in ${unit_folder}/${name}/${unit}.service @ONLY)
  file(INSTALL ${unit_folder}/${name}/${unit}.service DESTINATION ${CMAKE_INSTALL_PREFIX}/lib/systemd/system)
endforeach()
file(REMOVE_RECURSE ${unit_folder}/${name})
