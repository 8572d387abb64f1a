// SPDX-License-Identifier: BSD-3-Clause
// What X11/X.h, Xlib.h, Xutil.h, windows.h and complex.h leave behind: plain words as macros (own list; what
// begins with X, Button or GC, and what ends in Mask or Notify, is no word that another project would take).
#pragma once

// Xlib.h
#define Status int
#define Bool int
#define True 1
#define False 0
#define Success 0
#define None 0L
#define Always 2
#define NotUseful 0
#define WhenMapped 1
#define Above 0
#define Below 1
#define TopIf 2
#define BottomIf 3
#define Opposite 4
#define Complex 0
#define Nonconvex 1
#define Convex 2
#define Unsorted 0
#define YSorted 1
#define Expose 12
#define KeyPress 2
#define KeyRelease 3
#define FocusIn 9
#define FocusOut 10
#define ClientMessage 33
#define GenericEvent 35
#define LASTEvent 36
#define CursorShape 0
#define TileShape 1
#define StippleShape 2
#define CurrentTime 0L
#define NoSymbol 0L
#define NoExpose 14
#define NoValue 0x0000
#define XValue 0x0001
#define WidthValue 0x0004
#define HeightValue 0x0008
#define AllValues 0x000F
#define InputOutput 1
#define InputOnly 2
#define InputFocus 1L
#define AnyKey 0L
#define AnyButton 0L
#define AllPlanes ((unsigned long)~0L)
#define GrayScale 1
#define StaticGray 0
#define StaticColor 2
#define PseudoColor 3
#define TrueColor 4
#define DirectColor 5
#define LSBFirst 0
#define MSBFirst 1
#define NormalState 1
#define ZoomState 2
#define IconicState 3
#define InactiveState 4
#define BadValue 2
#define BadMatch 8
#define BadAccess 10
#define BadAlloc 11
#define BadLength 16
#define BadName 15
#define DoRed (1 << 0)
#define DoGreen (1 << 1)
#define DoBlue (1 << 2)
#define LineSolid 0
#define FillSolid 0
#define FillTiled 1
#define WindingRule 1
#define EvenOddRule 0
#define FontChange 255
#define RectangleIn 1
#define RectangleOut 0
#define RectanglePart 2
#define DestroyAll 0
#define PropertyDelete 1
#define DefaultDepth(dpy, scr) (0)
#define DefaultScreen(dpy) (0)
#define RootWindow(dpy, scr) (0)
#define ConnectionNumber(dpy) (0)
#define DisplayWidth(dpy, scr) (0)
#define DisplayHeight(dpy, scr) (0)
#define ScreenCount(dpy) (0)

// windows.h
#define min(a, b) (((a) < (b)) ? (a) : (b))
#define max(a, b) (((a) > (b)) ? (a) : (b))
#define near
#define far
#define NEAR
#define FAR
#define IN
#define OUT
#define OPTIONAL
#define CONST const
#define VOID void
#define TRUE 1
#define FALSE 0
#define ERROR 0
#define NO_ERROR 0L
#define ABSOLUTE 1
#define RELATIVE 2
#define ALTERNATE 1
#define WINDING 2
#define OPAQUE 2
#define TRANSPARENT 1
#define DIFFERENCE 11
#define DELETE (0x00010000L)
#define SYNCHRONIZE (0x00100000L)
#define INFINITE 0xFFFFFFFF
#define IGNORE 0
#define STRICT 1
#define THIS void
#define PURE = 0
#define small char
#define hyper __int64
#define interface struct
#define cdecl
#define pascal
#define RGB(r, g, b) ((r) | (g) << 8 | (b) << 16)
#define Yield()
#define GetObject GetObjectA
#define GetMessage GetMessageA
#define SendMessage SendMessageA
#define CreateWindow CreateWindowA
#define CreateFile CreateFileA
#define DeleteFile DeleteFileA
#define CopyFile CopyFileA
#define MoveFile MoveFileA
#define LoadImage LoadImageA
#define DrawText DrawTextA
#define FindText FindTextA
#define GetClassName GetClassNameA
#define GetCurrentTime() (0)
#define GetFreeSpace(w) (0x100000L)

// complex.h
#define I (__extension__ 1.0iF)
