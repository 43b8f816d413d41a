# Writes the image to a board: WAY is "flash" (debug probe over SWD) or "flash-rom" (ROM loader on USART3).
#
# Vectors and code are written one by one; an image in one piece would erase the parameters between them.
set(vectors "${IMAGE}.vectors.bin")
set(code "${IMAGE}.code.bin")
set(vectors_address 0x08000000)
set(code_address 0x0800C000)

function(run_or_stop)
  execute_process(COMMAND ${ARGV} RESULT_VARIABLE result)
  if(NOT result EQUAL 0)
    list(GET ARGV 0 tool)
    message(FATAL_ERROR "${tool} did not succeed; what it says is above. Is the board powered and connected?")
  endif()
endfunction()

if(WAY STREQUAL "flash")
  find_program(openocd openocd)
  find_program(stflash st-flash)
  if(openocd)
    run_or_stop("${openocd}" -f interface/stlink.cfg -f target/stm32f4x.cfg
      -c "program {${code}} ${code_address} verify"
      -c "program {${vectors}} ${vectors_address} verify reset exit")
  elseif(stflash)
    run_or_stop("${stflash}" write "${code}" ${code_address})
    run_or_stop("${stflash}" --reset write "${vectors}" ${vectors_address})
  else()
    message(FATAL_ERROR "Neither openocd nor st-flash is installed. On Debian: apt-get install openocd, "
                        "or apt-get install stlink-tools")
  endif()
elseif(WAY STREQUAL "flash-rom")
  find_program(stm32flash stm32flash)
  if(NOT stm32flash)
    message(FATAL_ERROR "stm32flash is not installed. On Debian: apt-get install stm32flash")
  endif()
  set(port "$ENV{TRUING_PORT}")
  if(NOT port)
    set(port /dev/ttyUSB0)
    message(STATUS "TRUING_PORT is not set; using ${port}")
  endif()
  run_or_stop("${stm32flash}" -b 115200 -S ${code_address} -w "${code}" -v "${port}")
  # -c: the loader has taken its baud rate from the first connection.
  run_or_stop("${stm32flash}" -c -b 115200 -S ${vectors_address} -w "${vectors}" -v "${port}")
  message(STATUS "Written. Take BOOT0 back to 0 and reset the board.")
else()
  message(FATAL_ERROR "WAY must be flash or flash-rom")
endif()
