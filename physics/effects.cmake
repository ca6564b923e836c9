# SPDX-License-Identifier: Apache-2.0
# stickslip_effects(SOURCES LIST FOLDER...): every *.cpp of the folders is one effect, and NAME.cpp
# defines `const Effect& NAME()`. Sets SOURCES to these files and LIST to a generated file that lists
# them for the catalogue; a file that is added or removed is noticed at the next build. A program
# that compiles its own list uses it in place of the one in the library `physics`.
function(stickslip_effects sources list)
  set(files)
  set(STICKSLIP_EFFECT_DECLARATIONS)
  set(STICKSLIP_EFFECT_ADDRESSES)
  foreach(folder ${ARGN})
    file(GLOB found CONFIGURE_DEPENDS ${folder}/*.cpp)
    list(APPEND files ${found})
  endforeach()
  foreach(file ${files})
    get_filename_component(name ${file} NAME_WE)
    string(APPEND STICKSLIP_EFFECT_DECLARATIONS "const Effect& ${name}();\n")
    string(APPEND STICKSLIP_EFFECT_ADDRESSES "      &${name}(),\n")
  endforeach()
  configure_file(${CMAKE_CURRENT_FUNCTION_LIST_DIR}/effect_list.cpp.in
    ${CMAKE_CURRENT_BINARY_DIR}/effect_list.cpp @ONLY)
  set(${sources} ${files} PARENT_SCOPE)
  set(${list} ${CMAKE_CURRENT_BINARY_DIR}/effect_list.cpp PARENT_SCOPE)
endfunction()
